#!/usr/bin/env python3
"""Parts of real machines compared with parts: alerts on parts without known faults, and parts under another program's label.

    PYTHONPATH=. .venv/bin/python benchmarks/recorded_parts.py

NIST plates, covers and boxes (feed, speed, line and tool at about 5 Hz, read once a second; these controls told no load), in the
order in which they were made. Spreads and tails are learned on the other groups, the course of a program in the stream alone: it
is judged from its second part, the plates in their first by the twin's feed and speed, each by itself. One threshold for all: it
was chosen on the covers, where no score is larger than 2.2, and left as it is for boxes and plates. A text that was changed is
another program.
"""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from benchmarks.evaluation.intervals import rate, share
from benchmarks.programs.plates import data_folder
from benchmarks.recorded.happened import happened
from benchmarks.recorded.labels import Outcome, Trial, of_parts, of_the_twin, outcome
from benchmarks.recorded.parts import Part, control_parts, nist_parts
from benchmarks.recorded.replaying import Alert, Judgement, judgement, taught
from twin.anomaly.alarm import AlarmRule
from twin.anomaly.parts.model import PartsModel

GROUPS = ("cover", "box", "plate")
RULE = AlarmRule(2.5, 2)
FITTED = ("plate 13/1", "plate 14/1", "plate 15/1")
NOT_WHOLE = ("PLATE-4", "PLATE-19 (12 lines)")
"""The program of plate 4 is what was left of it; the first run of plate 19 told no line."""
WEEK_H = 168.0


def by_text(parts: Sequence[Part]) -> list[Part]:
    """Return the parts labelled with the text that ran."""
    return [part.labelled(part.text) for part in parts]


def others(groups: Mapping[str, Sequence[Part]], name: str) -> list[Part]:
    """Return the parts of the other groups, in order of time, labelled with their texts."""
    found = [part for group, parts in groups.items() if group != name for part in by_text(parts)]
    return sorted(found, key=lambda part: part.started_s)


def twin_model(groups: Mapping[str, Sequence[Part]], folder: Path) -> PartsModel:
    """Return the model for the plates: taught by covers, boxes and the plates that the twin is fitted to."""
    fitted = [part for part in groups["plate"] if part.name in FITTED]
    return taught(sorted([*others(groups, "plate"), *fitted], key=lambda part: part.started_s), folder)


def show(title: str, found: Judgement, folder: Path | None) -> tuple[int, float]:
    """Print what became of each part that was judged; return how many alerts there were in how many hours."""
    if title:
        print(f"\n{title}")
    hours, before = 0.0, dict[str, Part]()
    for span in found.spans:
        judged_s = found.judged_s(span)
        if judged_s:
            print(f"  {span.part.name:11} {span.part.text:27} judged {judged_s:5.0f} s  largest score {found.largest(span):5.2f}")
        hours += judged_s / 3600.0
        for alert in found.alerts:
            if alert.part is span.part:
                truth = happened(span.part, alert.at_s, before.get(span.part.label), folder)
                print(f"      {in_words(alert)}\n      in truth: {truth}")
        before[span.part.label] = span.part
    return len(found.alerts), hours


def in_words(alert: Alert) -> str:
    """Return an alert as its reason says it."""
    why = alert.why
    lines = "" if why.lines is None else f", lines {why.lines[0]} to {why.lines[1]}"
    units = f": {why.measured:.0f} {why.unit}, expected {why.expected:.0f}" if why.expected else ""
    return f"ALERT after {alert.at_s:.0f} s: {why.signal} over {why.scale}, T{why.tool}{lines}{units} by {why.by}"


def told(one: Outcome, folder: Path | None = None) -> str:
    """Return a trial in a line or two."""
    part, label, alert = one.trial.part, one.trial.label, one.alert
    verdict = "no alert" if alert is None else f"alert after {alert.at_s:.0f} s"
    if one.stranger_s is not None:
        verdict += f", a tool that is new to it after {one.stranger_s:.0f} s"
    truth = "right" if one.trial.is_right else "WRONG"
    judged = f"judged {one.judged_s:5.0f} s, largest {one.most:5.2f}: {verdict}"
    line = f"  {truth}  label {label:15} ran {part.text:27} ({part.name:11}) {judged}"
    if alert is None:
        return line
    earlier = one.trial.history[-1] if one.trial.history else None
    what = happened(part.labelled(label), alert.at_s, earlier, folder)
    return f"{line}\n           {in_words(alert)}\n           in truth: {what}"


def twins(outcomes: Sequence[Outcome], folder: Path) -> None:
    """Print what the twin alone makes of every plate under every label."""
    right = [one for one in outcomes if one.trial.is_right]
    wrong = [one for one in outcomes if not one.trial.is_right]
    found = [one.alert.at_s for one in wrong if one.alert is not None]
    print(f"\nPlates under every label, in the first part, by the twin alone (feed and speed by line): {len(outcomes)} trials")
    print(f"  wrong label found: {len(found)} of {len(wrong)}, {share(len(found), len(wrong))}; ", end="")
    print("after " + ", ".join(f"{q} % {np.percentile(found, q):.0f} s" for q in (10, 50, 90)) if found else "")
    print(f"  right label with an alert: {sum(one.alert is not None for one in right)} of {len(right)}")
    for one in [*(one for one in wrong if one.alert is None), *(one for one in right if one.alert is not None)]:
        print(told(one, folder))


def controls(folder: Path) -> None:
    """Print what can be judged of controls that tell no line."""
    print("\nControls that tell no line (load, speed, feed)")
    for machine, recording, devices in (
        ("Okuma", "mtconnect/okuma.txt", "mtconnect/okuma_devices.xml"),
        ("Mazak01", "nist/raw/Mazak01-20180718-20180719.txt", "nist/devices.xml"),
        ("Mazak03", "nist/raw/Mazak03-20170629-20170630.txt", "nist/devices.xml"),
    ):
        parts = control_parts(folder / recording, folder / devices, machine)
        labels = [part.label for part in parts]
        hours = sum(part.ticks for part in parts) / 3600.0
        print(f"  {machine}: {len(parts)} stretches of {len(set(labels))} programs, {hours:.1f} h; ", end="")
        try:
            found = judgement(taught(parts, None), parts, RULE, None)
        except ValueError as error:
            print(f"nothing is judged: {error}")
            continue
        judged_h = sum(found.judged_s(span) for span in found.spans) / 3600.0
        print(f"{judged_h:.2f} h judged, {len(found.alerts)} alerts")
        for alert in found.alerts:
            print(f"      {alert.part.name}: {in_words(alert)}")


def main() -> None:
    """Print the tables."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.parse_args()
    folder = data_folder()
    groups = {name: nist_parts(folder, name) for name in GROUPS}
    by_name = {part.name: part for parts in groups.values() for part in parts}
    models = {name: taught(others(groups, name), None) for name in GROUPS}
    alerts, hours = 0, 0.0
    for name in GROUPS:
        found = judgement(models[name], by_text(groups[name]), RULE, None)
        count, judged_h = show(f"{name}: parts beside earlier parts", found, None)
        alerts, hours = alerts + count, hours + judged_h
    print(f"\n{alerts} alerts in {hours:.2f} h judged: {rate(alerts, hours / WEEK_H)} a machine-week of machining")
    model = twin_model(groups, folder)
    plates = [part for part in groups["plate"] if part.label.startswith("PLATE-") and not part.text.startswith(NOT_WHOLE)]
    print("\nplates in their first part, by the twin alone")
    alerts, hours = 0, 0.0
    for part in plates:
        if part.name not in FITTED:
            count, judged_h = show("", judgement(model, [part], RULE, folder), folder)
            alerts, hours = alerts + count, hours + judged_h
    print(f"\n{alerts} alerts in {hours:.2f} h judged: {rate(alerts, hours / WEEK_H)} a machine-week of machining")
    print("\nLabels, beside earlier parts of the label")
    for trial in of_parts(by_name):
        print(told(outcome(models[trial.part.name.split()[0]], trial, RULE, folder)))
    print(told(outcome(model, Trial(by_name["plate 04/1"], "PLATE-4", is_right=False, has_twin=True), RULE, folder), folder))
    twins([outcome(model, trial, RULE, folder) for trial in of_the_twin(plates, sorted({one.label for one in plates}))], folder)
    controls(folder)


if __name__ == "__main__":
    main()
