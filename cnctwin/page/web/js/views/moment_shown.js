// A moment of the past: state, program, tool, suppression window, figures, and the description that was live.

import { SCORES, valueAt } from "../charted.js";
import { el, setText } from "../dom.js";
import { SUPPRESSION_MEANS, execution, number, plain } from "../text.js";
import { ALERT_STATE, TOOL_CHANGE_GATE } from "../vocabulary.js";

export class MomentShown {
  constructor() {
    this.parts = {};
    const named = (key, term, wide = "", about = null) => {
      this.parts[key] = el("dd");
      return el("div", { class: wide, title: about }, el("dt", {}, term), this.parts[key]);
    };
    this.element = el(
      "dl",
      { class: "then", "aria-live": "off" },
      named("exec_state", "State"),
      named("program", "Program", "wide"),
      named("tool_number", "Tool"),
      named("nc_line", "Line"),
      named("nc_block", "Block", "wide"),
      named("gate", "Suppression window", "", SUPPRESSION_MEANS),
      named("spindle_rpm", "Speed"),
      named("spindle_load_pct", "Load"),
      named("feed_mm_min", "Feed"),
      named("score", "Adjusted score"),
      named("alarm", "Control alarm"),
      named("alert", "Alert"),
      named("description", "Twin's description", "wide", "the description of the machine by which the twin computed then"),
    );
  }

  /** description: the one that was live then, in words; null where it is not known */
  write(past, t, description = null) {
    const at = (signal) => valueAt(past, signal, t),
      { parts } = this;
    const put = (key, text) => {
      setText(parts[key], text ?? "–");
      parts[key].classList.toggle("quietly", text === null || text === undefined);
    };
    const unit = (signal, name) => (at(signal) === null ? null : `${number(at(signal), name)} ${name}`);
    put("exec_state", at("exec_state") === null ? null : execution(at("exec_state"))[0]);
    put("program", at("program"));
    put("tool_number", at("tool_number") === null ? null : `T${at("tool_number")}`);
    put("nc_line", at("nc_line") === null ? null : plain(at("nc_line")));
    put("nc_block", at("nc_block"));
    put("gate", at(TOOL_CHANGE_GATE) === null ? null : at(TOOL_CHANGE_GATE) ? "yes" : "no");
    put("spindle_rpm", unit("spindle_rpm", "rev/min"));
    put("spindle_load_pct", unit("spindle_load_pct", "%"));
    put("feed_mm_min", unit("feed_mm_min", "mm/min"));
    put("score", at(SCORES.adjusted) === null ? null : number(at(SCORES.adjusted)));
    put("description", description);
    put("alarm", at("alarm") === "" ? "none" : at("alarm"));
    put("alert", at(ALERT_STATE));
  }
}
