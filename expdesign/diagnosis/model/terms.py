"""The terms of an extended model, the library of terms that may be added, and groups of inputs."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from expdesign.estimation.regression import Polynomial, lift, symbol
from expdesign.simulation.program import Evaluation, evaluation
from expdesign.values import Array
from expdesign.vessel import NUMPY, TERMS, Operators, Response, Term, VesselModel, stem
from expdesign.vessel.quantities import rows_of
from expdesign.vessel.structures import FORCE_SIGNALS, FUNCTIONS, MOTION_SIGNALS, Expression, parse_expression

Effects = Mapping[str, float]
AIR_SIGNALS = frozenset({"u_q", "v_q"})  # velocity through the air
LINEAR = 2.0 + 1e-9  # growth of a linear term from one speed to its double
MOST_SUMS = 12  # in a regressor that is written as a sum of products; those of ship models have a few


@dataclass(frozen=True, kw_only=True)
class ScaledTerm:
    """One term of the extended model with its factors."""

    equation: str  # u, v or r
    expression: Expression  # its regressor, with what inputs alone make as signals of their own (`with_input_products`)
    factor: float  # its parameter with all factors, as an acceleration
    after: float = 0.0  # change of the factor after the change point
    # coriolis, damping, reads_air, reads_turn: its kind
    coriolis: bool = False
    damping: bool = False
    reads_air: bool = False
    reads_turn: bool = False


def own_terms(model: VesselModel, effects: Effects) -> list[ScaledTerm]:
    """The model's own terms."""

    def get(key: str) -> float:
        return effects.get(key, 0.0)

    parts = []
    for kind, value in zip(_term_kinds(model), model.parameters.tolist(), strict=True):
        name, equation = kind.name, kind.equation
        whole, changed = value + get(f"theta:{name}"), 0.0
        if kind.thrust:
            whole *= (1 + get("gain")) * (1.0 if kind.rudder else 1 + get("gain:propeller"))
            changed = whole * get("change:gain")
        elif kind.damping:
            changed = whole * (get("change:damping") + get(f"change:damping_{equation}"))
        parts.append(
            ScaledTerm(
                equation=equation,
                expression=kind.expression,
                factor=whole / model.time_scale_s,
                after=changed / model.time_scale_s,
                coriolis=kind.coriolis,
                damping=kind.damping,
                reads_air=kind.air,
                reads_turn=kind.turn,
            )
        )
    return parts


def term_factors(model: VesselModel, effects: Effects) -> dict[str, float]:
    """Factors of gains and inertia on every parameter of the model."""
    result = {}
    for kind in _term_kinds(model):
        result[kind.name] = 1.0 if kind.coriolis else 1.0 / (1 + effects.get(f"inertia:{kind.equation}", 0.0))
        if kind.thrust:
            result[kind.name] *= 1 + effects.get("gain", 0.0)
            result[kind.name] *= 1.0 if kind.rudder else 1 + effects.get("gain:propeller", 0.0)
    return result


def library_terms(model: VesselModel, library: Mapping[str, Term], effects: Effects) -> list[ScaledTerm]:
    """Library terms that were added."""
    known = (*MOTION_SIGNALS, *dict.fromkeys((*FORCE_SIGNALS, *model.inputs)))
    parts = []
    for key, value in effects.items():
        if key.startswith("term:"):
            term = library[key[5:]]
            expression = _parsed(term.expression, known)
            parts.append(
                ScaledTerm(
                    equation=term.equation,
                    expression=with_input_products(expression, driving_signals(model)),
                    factor=value / model.time_scale_s,
                    reads_air=bool(AIR_SIGNALS & set(expression.signals)),
                    reads_turn="tau_psi" in expression.signals,
                )
            )
    return parts


def unit_terms(model: VesselModel, library: Mapping[str, Term], effects: Effects) -> dict[str, ScaledTerm]:
    """Effect -> what a unit more of it adds to the terms, for every parameter and every library term."""
    more = {**effects, **{f"theta:{name}": effects.get(f"theta:{name}", 0.0) + 1.0 for name in model.names}}
    pairs = zip(model.names, own_terms(model, more), own_terms(model, effects), strict=True)
    own = {
        f"theta:{name}": replace(one, factor=one.factor - now.factor, after=one.after - now.after)
        for name, one, now in pairs
    }
    keys = [f"term:{name}" for name in library]
    return own | dict(zip(keys, library_terms(model, library, dict.fromkeys(keys, 1.0)), strict=True))


@lru_cache(maxsize=512)
def _parsed(text: str, known: tuple[str, ...]) -> Expression:
    return parse_expression(text, signals=known)


@dataclass(frozen=True, kw_only=True)
class TermKind:
    """Kind of a term."""

    name: str
    equation: str
    expression: Expression
    thrust: bool
    rudder: bool
    damping: bool
    coriolis: bool
    air: bool
    turn: bool


@lru_cache(maxsize=64)
def _term_kinds(model: VesselModel) -> tuple[TermKind, ...]:
    inputs = driving_signals(model)
    return tuple(
        TermKind(
            name=term.name,
            equation=term.equation,
            expression=with_input_products(expression, inputs),
            thrust=is_thrust(expression, model),
            rudder=reads_rudder(expression),
            damping=is_damping(term, expression, model),
            coriolis=is_coriolis(term),
            air=bool(AIR_SIGNALS & set(expression.signals)),
            turn="tau_psi" in expression.signals,
        )
        for term, expression in zip(model.terms, model.expressions, strict=True)
    )


def _text(whole: Polynomial) -> str:
    """In the language of expressions."""
    rows = [names if size == 1.0 and names else (repr(size), *names) for names, size in whole.terms.items()]
    return " + ".join("*".join(names) for names in rows) or "0"


def _called(name: str) -> Callable[[Polynomial | float], Polynomial | float]:
    return lambda x: symbol(f"{name}({_text(x)})") if isinstance(x, Polynomial) else float(getattr(np, name)(x))


CALLED = Operators(*map(_called, FUNCTIONS))
WORDS = {"*": "_by_", "(": "_of_", "+": "_plus_", "-": "_minus_", ".": "_point_"}
"""What stands for marks of an expression in the name of a signal."""


@lru_cache(maxsize=64)
def driving_signals(model: VesselModel) -> tuple[str, ...]:
    """Inputs and forces, but for the yaw moment, which may lean on the force ahead (`ahead_force`)."""
    return tuple(name for name in dict.fromkeys((*model.inputs, *FORCE_SIGNALS)) if name != "tau_psi")


def with_input_products(expression: Expression, inputs: tuple[str, ...]) -> Expression:
    """The same with every product of inputs as one signal, whose mean over an integrator step is the mean to take.

    Inputs may change within a step, and the mean of n |n| is not that of the mean n. Products with the motion are left,
    because motion hardly changes within a step, and so are expressions of more than `MOST_SUMS`.
    """
    return _with_input_products(expression.text, expression.signals, inputs)[0]


@lru_cache(maxsize=512)
def _with_input_products(
    text: str, signals: tuple[str, ...], inputs: tuple[str, ...]
) -> tuple[Expression, Mapping[str, str]]:
    """The expression with these signals, and what each of them is: "mean_abs_of_n1_by_n1", abs(n1)*n1."""
    expression = parse_expression(text, signals=signals)
    if not {*inputs} & {*signals} or len(re.findall("[+-]", text)) > MOST_SUMS:
        return expression, {}
    whole = lift(expression.evaluate({name: symbol(name) for name in signals}, CALLED))
    products, parts = dict[str, str](), dict[tuple[str, ...], float]()
    for factors, size in whole.terms.items():
        own = [one for one in factors if {*re.findall(r"[A-Za-z_]\w*", one)} <= {*inputs, *FUNCTIONS}]
        product, rest = "*".join(own), [one for one in factors if one not in own]
        if own and product not in inputs:
            name = "mean_" + re.sub(r"\W", lambda mark: WORDS.get(mark[0], ""), product)
            products[name], rest = product, [*rest, name]
        else:
            rest += own
        parts[tuple(rest)] = size
    if not products:
        return expression, {}
    return parse_expression(_text(Polynomial(parts)), signals=(*signals, *products)), products


@lru_cache(maxsize=64)
def input_products(model: VesselModel, library: tuple[Term, ...]) -> Mapping[str, Expression]:
    """Signal -> what inputs alone make in the model's terms, in those of the library and in the force ahead."""
    inputs = driving_signals(model)
    known = (*MOTION_SIGNALS, *dict.fromkeys((*FORCE_SIGNALS, *inputs)))
    texts = [*(term.expression for term in (*model.terms, *library)), ahead_force_text(model)]
    read = [_with_input_products(text, _parsed(text, known).signals, inputs)[1] for text in texts]
    return {name: _parsed(text, inputs) for products in read for name, text in products.items()}


def ahead_force(signals: Mapping[str, Array], model: VesselModel) -> Array:
    """tau_x, of rudder ships n |n| of their propellers; zero without either."""
    return np.asarray(_ahead_force(model).values(signals)[0])


@lru_cache(maxsize=64)
def _ahead_force(model: VesselModel) -> Evaluation:
    expression = _parsed(ahead_force_text(model), (*FORCE_SIGNALS, *model.inputs))
    return evaluation([with_input_products(expression, driving_signals(model))])


def ahead_force_text(model: VesselModel) -> str:
    """The signal of `ahead_force` as an expression."""
    if any(set(e.signals) & set(FORCE_SIGNALS) for e in model.expressions):
        return "tau_x"
    return " + ".join(f"abs({name})*{name}" for name in model.inputs if stem(name) == "n") or "0"


def asymmetry_terms(model: VesselModel) -> list[str]:
    """Names of the model's terms by which ahead force turns it."""
    text = ahead_force_text(model)
    return [term.name for term in model.terms if term.equation == "r" and term.expression == text]


def turns_by_force(model: VesselModel) -> bool:
    """It reads tau_psi, so that a yaw moment acts as its inputs do."""
    return any("tau_psi" in expression.signals for expression in model.expressions)


def is_coriolis(term: Term) -> bool:
    """X_vr and Y_ur: ratios of inertias, which a change of load nearly keeps."""
    text = term.expression.replace(" ", "")
    return (term.equation, text) in {("u", "v*r"), ("u", "r*v"), ("v", "u*r"), ("v", "r*u")}


def is_thrust(expression: Expression, model: VesselModel) -> bool:
    """It reads an input."""
    return bool(set(expression.signals) & {*FORCE_SIGNALS, *model.inputs})


def reads_rudder(expression: Expression) -> bool:
    """It reads a rudder angle."""
    return any(name.startswith("rudder") for name in expression.signals)


@lru_cache(maxsize=64)
def resisting(model: VesselModel) -> Mapping[str, float]:
    """Sign of the parameters that have to resist: term -> -1, or 1 where its expression is negative.

    These are the terms that grow fastest with the velocity of their own equation alone, and faster than linearly, such
    as N_abs_r_r r |r|. With the other sign any motion that is fast enough runs away, which no ship does. Linear damping
    may push: many ships are unstable on course.
    """
    found: dict[str, tuple[float, str, float]] = {}
    for term, expression in zip(model.terms, model.expressions, strict=True):
        if set(expression.signals) != {term.equation}:
            continue
        back, one, two = (
            float(evaluation([expression]).values({term.equation: np.array(speed)})[0]) for speed in (-1.0, 1.0, 2.0)
        )
        growth = abs(two / one) if one and np.isclose(back, -one) else 0.0
        if growth > max(LINEAR, found.get(term.equation, (0.0,))[0]):
            found[term.equation] = growth, term.name, -float(np.sign(one))
    return {name: sign for _, name, sign in found.values()}


def is_damping(term: Term, expression: Expression, model: VesselModel) -> bool:
    """It resists: neither an input, nor air, nor Coriolis."""
    return not (is_thrust(expression, model) or is_coriolis(term) or AIR_SIGNALS & set(expression.signals))


MORE_TERMS = (
    Term("u", "X_vv", "v*v"),
    Term("u", "X_rr", "r*r"),
    Term("v", "Y_r", "r"),
    Term("v", "Y_uv", "u*v"),
    Term("v", "Y_abs_r_r", "abs(r)*r"),
    Term("r", "N_v", "v"),
    Term("r", "N_ur", "u*r"),
    Term("r", "N_abs_r_r", "abs(r)*r"),
    Term("u", "X_uuu", "u*u*u"),
    Term("v", "Y_vvv", "v*v*v"),
    Term("r", "N_rrr", "r*r*r"),
)
"""Second-order modulus terms that manoeuvring models often have beside the built-in ones, and cubic damping.

Source: M. A. Abkowitz, Lectures on ship hydrodynamics (1964), for the cubic terms.
"""
ADVANCE_LOSS = ("X_kappa", "X_un", "X_unn")  # terms of the thrust loss with advance speed
AIR = ("W_abs_u_u", "W_abs_v_v", "W_uv")  # library terms of the air


def term_library(model: VesselModel) -> Mapping[str, Term]:
    """Every term that may be added to a model: those of its equations whose regressor it does not have."""
    rng = np.random.default_rng(0)
    names = (*MOTION_SIGNALS, *dict.fromkeys((*FORCE_SIGNALS, *model.inputs)))
    table = {name: rng.standard_normal(12) for name in names}
    own = [
        (term.equation, expression.evaluate(table, NUMPY))
        for term, expression in zip(model.terms, model.expressions, strict=True)
    ]
    found = {}
    for term in (*TERMS.values(), *MORE_TERMS, *_advance(model)):
        if term.name in model.names or term.equation not in model.outputs:
            continue
        if not _readable(term, model):
            continue
        values = parse_expression(term.expression, signals=names).evaluate(table, NUMPY)
        if not any(term.equation == equation and _parallel(values, other) for equation, other in own):
            found[term.name] = term
    return found


def _advance(model: VesselModel) -> tuple[Term, ...]:
    """Advance loss of propellers that drive the model by their speeds, not through tau_x.

    Thrust rho n^2 D^4 K_T(J) with K_T linear in J = u / (n D) has a term in u |n|; if the wake slows with
    the thrust, it is u n |n|.

    Source: A. F. Molland, S. R. Turnock, D. A. Hudson, Ship Resistance and Propulsion (2011), ch. 12, for K_T(J).
    """
    read = {name for term, e in zip(model.terms, model.expressions, strict=True) if term.equation == "u"
            for name in e.signals}  # fmt: skip
    speeds = [name for name in model.inputs if stem(name) == "n" and name in read]
    if not speeds:
        return ()
    return (
        Term("u", "X_un", " + ".join(f"u*abs({name})" for name in speeds)),
        Term("u", "X_unn", " + ".join(f"u*abs({name})*{name}" for name in speeds)),
    )


def own_advance_terms(model: VesselModel) -> list[str]:
    """Names of the model's terms that are an advance loss."""
    rng = np.random.default_rng(0)
    names = (*MOTION_SIGNALS, *dict.fromkeys((*FORCE_SIGNALS, *model.inputs)))
    table = {name: rng.standard_normal(12) for name in names}
    losses = [
        parse_expression(term.expression, signals=names).evaluate(table, NUMPY)
        for term in (TERMS["X_kappa"], *_advance(model))
    ]
    return [
        term.name
        for term, expression in zip(model.terms, model.expressions, strict=True)
        if term.equation == "u" and any(_parallel(expression.evaluate(table, NUMPY), loss) for loss in losses)
    ]


def own_air_terms(model: VesselModel) -> list[str]:
    """Names of the model's terms that read the relative wind."""
    return [
        term.name
        for term, expression in zip(model.terms, model.expressions, strict=True)
        if AIR_SIGNALS & set(expression.signals)
    ]


def _readable(term: Term, model: VesselModel) -> bool:
    """Whether the model is driven by the generalised forces that a term reads."""
    through_force = any(set(expression.signals) & set(FORCE_SIGNALS) for expression in model.expressions)
    return through_force or not any(name in term.expression for name in FORCE_SIGNALS)


def _parallel(a: np.ndarray, b: np.ndarray) -> bool:
    return bool(abs(abs(a @ b) - np.linalg.norm(a) * np.linalg.norm(b)) < 1e-9 * np.linalg.norm(a) * np.linalg.norm(b))


RESPONSES = {row.effects[0]: row.key for row in rows_of(Response)}
"""Kind of effect of a group of inputs -> field of `vessel.Response`, in the order in which they act.

The effect of a slew rate is its inverse, the time that a change of one unit takes, so that zero changes nothing.
"""
FOLLOWING = ("slew", "lag", "delay", "lead")  # kinds of effects of a group of inputs that are times, from zero on
LEAST_EFFECT = 1e-6  # size of such an effect that is taken for zero: derivatives by times are differences upward


def response_effect(kind: str, value: float) -> float:
    """From a field of `vessel.Response` to the effect or back: the inverse of a slew rate, else the same."""
    return (1.0 / value if value else math.inf) if kind == "slew" else value


def group_columns(group: str, inputs: tuple[str, ...]) -> list[int]:
    """Columns of the inputs that belong to a group."""
    return [index for index, name in enumerate(inputs) if group in ("all", name) or stem(name) == group]


def input_groups(inputs: tuple[str, ...]) -> list[str]:
    """All inputs, those of one stem, single ones; of groups with the same members the first."""
    stems = sorted({stem(name) for name in inputs})
    groups = ["all", *(stems if len(stems) > 1 else []), *inputs]
    taken: dict[tuple[int, ...], str] = {}
    for group in groups:
        taken.setdefault(tuple(group_columns(group, inputs)), group)
    return list(taken.values())


def values_by_group(values: Mapping[str, float], inputs: tuple[str, ...]) -> dict[str, float]:
    """Nonzero values of single inputs, by stem where all inputs of a stem have the same."""
    left, found = list(inputs), dict[str, float]()
    several = len({stem(name) for name in inputs}) > 1
    for group in input_groups(inputs)[several:]:
        names = [inputs[column] for column in group_columns(group, inputs)]
        shared = {values.get(name, 0.0) for name in names}
        if set(names) <= set(left) and len(shared) == 1:
            found[group] = shared.pop()
            left = [name for name in left if name not in names]
    return {group: value for group, value in found.items() if value}
