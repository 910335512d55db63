"""Verdict of `cfem train` on a model in words: its errors, and why it should not be trusted, if so."""

from typing import Any

from cfem.condensed.mesh_error import mesh_error_of
from cfem.condensed.model_error import model_error_of
from cfem.core.artefact.judgement import INDEFINITE_SHARE, LOSS, poor
from cfem.core.console.shown import counted, duration, length
from cfem.motion.error import frequency_error_of
from cfem.surrogate.calibration import ENOUGH, PROBABILITY

LEAST = 1e-6  # mm: a smaller bound says no more
FEWEST = 10  # test states from which figures say something of others


def headline(results: dict[str, Any], units: dict[str, Any]) -> list[str]:
    """Errors in mm and N (MPa of chambers) before the loss, then what is wrong. units: of the dataset's columns."""
    unit = units.get("lambda_a", "N")  # a list where the actuators differ
    force = unit if isinstance(unit, str) else " or ".join(sorted(set(unit), reverse=True))
    errors, definite = results["errors"], results["positive_definite"]
    states, caution = errors["states"], ""
    if states < FEWEST:
        caution = f" (a figure of {counted(states, 'state')} says little of others: sample more test rows)"
    loss = f"the paper's loss {errors['loss']:.2e}, the same loss of whole vectors {errors['frame_loss']:.2e}"
    if _unjudged(errors):
        loss = "the paper's loss is not known, as the test states do not differ"
    samples, tip, driven = counted(results["samples"], "sample"), errors["tip_mm"]["max"], errors["force_N"]["max"]
    lines = [
        f"{results['kind']}, {samples}: largest errors {length(tip)} at the tip and {driven:.2g} {force} on "
        f"{counted(states, 'test state')}{caution}; {loss}; "
        f"fitted in {duration(results['seconds_fit'])}, {duration(1e-6 * results['microseconds_query'])} per query"
    ]
    stated = model_error_of(results.get("model_error"))
    if stated is not None:
        reaction, share = "displacements" if stated.command == "force" else "forces", 100 * stated.actuators.everywhere
        few = f" ({ENOUGH} test states in it promise {100 * PROBABILITY:.0f} %)" if stated.states < ENOUGH else ""
        lines.append(
            f"the tip is at most {length(max(stated.tip.everywhere, LEAST))} off, {reaction} {share:.2g} % of the "
            f"largest, in {stated.percent} of the unseen states of its domain{few}; "
            "model.error(state) bounds each state by its place"
        )
    lines += [_errors_line(point) for point in results["learning_curve"]]
    if (frequencies := frequency_error_of(results.get("motion"))) is not None:
        held, free = (
            ", ".join(f"{100 * each.everywhere:.2g}" for each in bounds)
            for bounds in (frequencies.held, frequencies.free)
        )
        lines.append(f"{frequencies.words}: {held} % with the actuators held, {free} % free")
    known = mesh_error_of(results.get("mesh_error"))
    if known is not None:
        low, high = (100 * share for share in known.tip.far)
        lines.append(
            f"the mesh of the samples adds {low:.2g} to {high:.2g} % of the effectors' travel, where it is largest"
        )
    if "skin" in results:
        lines.append(skin_line(results["skin"]))
    if definite["share"] < 1:
        lines.append(
            f"W is not positive definite at {100 * (1 - definite['share']):.2g} % of {definite['queries']} random "
            "states between the samples: more samples, or a lower max_degree, may help"
        )
    if errors.get("buckled_states"):
        lines.append(
            f"{errors['buckled_states']} of {errors['states']} test states would buckle if nothing held them; "
            f"the loss of whole vectors of the others is {errors['loss_of_stable']:.2e}"
        )
    return lines


def _errors_line(point: dict[str, Any]) -> str:
    """Line about the errors of one point of the learning curve."""
    errors = point["errors"]
    tip, force, W = (
        f"{errors[name]['rms']:.2g}, {errors[name]['max']:.2g} %"
        for name in ("tip_percent_of_length", "force_percent", "W_percent")
    )
    return (
        f"{counted(point['samples'], 'sample')}, root mean square and largest errors: tip {tip} of the length; "
        f"actuators {force} of the largest; W_ij {W} of the root of W_ii W_jj"
    )


def judged(results: dict[str, Any]) -> list[dict[str, Any]]:
    """Reasons why the model should not be trusted, empty where it may be."""
    errors, definite, reasons = results["errors"], results["positive_definite"], []
    if _unjudged(errors):
        reasons.append(
            poor(f"the {errors['states']} test states do not differ, and nothing tells how good the model is")
        )
    if not (loss := errors["frame_loss"]) <= LOSS:
        tip = f"the tip is {errors['tip_mm']['max']:.2g} mm away at the worst test state"
        reasons.append(poor(f"loss of whole vectors {loss:.2e}, where a usable model stays below {LOSS:g}: {tip}"))
    if not definite["share"] >= 1 - INDEFINITE_SHARE:
        share = f"{100 * (1 - definite['share']):.2g} % of {definite['queries']} random states"
        reasons.append(poor(f"W is not positive definite at {share}: control may find no command there"))
    return reasons


def _unjudged(errors: dict[str, Any]) -> bool:
    """True where the test states are one state, in whose variance the losses have no unit."""
    return errors.get("entries") == 0


def skin_line(skin: dict[str, Any]) -> str:
    """Line about the results' "skin": the errors with all modes, and with fewer."""
    share, count, largest = skin["largest_percent_of_length"], skin["modes"], length(skin["largest_mm"])
    few = sorted({max(1, count // 4), max(1, count // 2)} - {count}) if "front" in skin else []
    fewer = "".join(f"; with {counted(number, 'mode')} {length(skin['front']['largest_mm'][number])}" for number in few)
    return (
        f"skin: the largest error of {skin['nodes']} surface nodes is {largest} ({share:.2g} % of the length), "
        f"{length(skin['rms_mm'])} rms, with {counted(count, 'mode')}{fewer or skin.get('of', '')}"
    )
