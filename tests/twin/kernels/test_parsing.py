"""Syntax trees that several threads want at once."""

import ast
import gc
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from twin.kernels.parsing import parsed

TEXT = "\n".join(f"a{n} = ((b{n} + c{n}) * (d{n} - (e{n} / f{n}))) if g{n} else h{n}[(i{n}, [j{n}, k{n}])]" for n in range(60))


def side_by_side(parse: Callable[[str], ast.Module]) -> list[ast.Module]:
    """Build trees in threads that take turns in the middle of a tree, as they do where a collection of garbage runs Python."""

    def take_turns(_phase: str, _info: object) -> None:
        time.sleep(1e-5)

    thresholds = gc.get_threshold()
    gc.callbacks.append(take_turns)
    gc.set_threshold(50)
    try:
        with ThreadPoolExecutor(4) as pool:
            return list(pool.map(parse, [TEXT] * 8))
    finally:
        gc.set_threshold(*thresholds)
        gc.callbacks.remove(take_turns)


def test_threads_that_build_trees_side_by_side_all_get_theirs() -> None:
    assert {ast.dump(tree) for tree in side_by_side(parsed)} == {ast.dump(ast.parse(TEXT))}
