"""Generations of a search: drawn values, and results reported to the optimiser."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from swgjoint.errors import MissingExtraError
from swgjoint.explore.optimise.file import OptimisationFile
from swgjoint.explore.optimise.front import Candidate
from swgjoint.explore.sweep.figures import Record
from swgjoint.explore.sweep.plan import Parameter, takes_whole_numbers
from swgjoint.explore.sweep.points import Values
from swgjoint.gear.design.design import Design

Evaluate = Callable[[list[Values]], list[Candidate]]

DIGITS = 5
"""Number of significant digits of the values that the search draws, as on a drawing."""
FAILED = 1e6
"""Violation of a design without figures, larger than any other violation [-]."""
NO_FIGURES = "no figures"
"""Name of the constraint that a design without figures violates."""


def search(
    file: OptimisationFile, start: Design, evaluate: Evaluate
) -> Iterator[list[Candidate]]:
    """Generations of NSGA-II; the first one contains the start design if possible.

    Args:
        file: Objectives, limits and parameters.
        start: Design whose values the first generation contains if the parameters allow
            them.
        evaluate: Function that computes the designs of some values, in their order.

    Yields:
        Designs of a generation with their results.

    Raises:
        MissingExtraError: If optuna is not installed.
    """
    try:
        import optuna
    except ImportError:
        raise MissingExtraError(
            "optimise needs optuna: pip install 'swgjoint[tune]'"
        ) from None
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    plan, parameters = file.plan, file.plan.parameters
    size = min(plan.population, plan.designs)
    with warnings.catch_warnings():  # optuna calls these operators experimental
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        # with two paraboloids of seven parameters as objectives, 480 designs cover 0.93
        # of at most 0.96; 0.90 with optuna's defaults, which only exchange values, and
        # 0.75 if the designs are drawn at random
        sampler = optuna.samplers.NSGAIISampler(
            population_size=size,
            seed=plan.seed,
            crossover=optuna.samplers.nsgaii.BLXAlphaCrossover(),
            mutation=optuna.samplers.nsgaii.PolynomialMutation(),
        )
    study = optuna.create_study(
        directions=["minimize"] * len(file.objectives), sampler=sampler
    )
    space = {p.column: _distribution(p, file.kinds) for p in parameters}
    if (first := _start_values(parameters, start)) is not None:
        study.enqueue_trial(first)
    left = plan.designs
    while left:
        trials = [study.ask(space) for _ in range(min(size, left))]
        left -= len(trials)
        found = evaluate([_values(parameters, trial.params) for trial in trials])
        for trial, candidate in zip(trials, found, strict=True):
            values, violations = _told(file, candidate.record)
            for name, violation in violations.items():
                trial.set_constraint(name, violation)
            study.tell(trial, values)
        yield found


def _told(
    file: OptimisationFile, record: Record
) -> tuple[list[float], dict[str, float]]:
    """Objectives to minimise, and violations of the limits, for the optimiser."""
    figures = [record.figures.get(o.figure) for o in file.objectives]
    if not record.ok or None in figures:
        return [0.0] * len(figures), {NO_FIGURES: FAILED}
    signed = zip(file.objectives, figures, strict=True)
    values = [o.sign * value for o, value in signed if value is not None]
    return values, {NO_FIGURES: 0.0, **file.violations(record.figures)}


def _distribution(parameter: Parameter, kinds: tuple[str, ...]) -> Any:
    from optuna import distributions

    if parameter.values is not None:
        return distributions.CategoricalDistribution(range(len(parameter.values)))
    assert parameter.low is not None and parameter.high is not None
    if takes_whole_numbers(parameter, kinds):
        return distributions.IntDistribution(
            round(parameter.low), round(parameter.high)
        )
    return distributions.FloatDistribution(parameter.low, parameter.high)


def _values(parameters: Sequence[Parameter], drawn: Mapping[str, Any]) -> Values:
    """Parameter values from the values that the optimiser has drawn."""
    found: Values = {}
    for parameter in parameters:
        value = drawn[parameter.column]
        if parameter.values is not None:
            value = parameter.values[value]
        elif isinstance(value, float):
            assert parameter.low is not None and parameter.high is not None
            near = float(f"{value:.{DIGITS}g}")
            value = min(max(near, parameter.low), parameter.high)
        found[parameter.column] = value
    return found


def _start_values(
    parameters: Sequence[Parameter], start: Design
) -> dict[str, Any] | None:
    """Values of the start design for the optimiser; None if they are out of range."""
    content, found = start.model_dump(), {}
    for parameter in parameters:
        values = [_at(content, key) for key in parameter.keys]
        value = values[0]
        if any(other != value for other in values):
            return None
        if parameter.values is not None:
            if value not in parameter.values:
                return None
            value = parameter.values.index(value)
        else:
            assert parameter.low is not None and parameter.high is not None
            if not isinstance(value, int | float):
                return None
            if not parameter.low <= value <= parameter.high:
                return None
        found[parameter.column] = value
    return found


def _at(content: Any, key: str) -> Any:
    for name in key.split("."):
        content = content.get(name) if isinstance(content, Mapping) else None
    return content
