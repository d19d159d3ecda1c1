"""The paper's errata: the one list from which report, docs/errata.md, EQUATIONS.md and the article are made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from . import errata_identities as identities
from . import errata_runs as seen
from .runs import Results


@dataclass(frozen=True)
class Erratum:
    """One row, with its evidence: the algebra in `why`, an identity that a program checks, runs that show it."""

    where: str
    printed: str
    correct: str
    why: str
    fields: tuple[str, ...] = ()  # fields of the scenario that choose the reading or handle the erratum
    identity: Callable[[], str] | None = None
    runs: Callable[[Results], str] | None = None

    def evidence(self, found: Results) -> str:
        """Sentences of the program and of the runs; empty where the algebra is all."""
        checked = [self.identity()] if self.identity else []
        return " ".join(checked + ([self.runs(found)] if self.runs else []))


# First the three that the two readings switch, then the others in the paper's order.
ERRATA = (
    Erratum(
        "(42), (44)",
        "dΩ̂ᵀ/dt = −P (v sᵀ + s vᵀ)",
        "dΩ̂ᵀ/dt = −P (v sᵀ − s vᵀ), that is dΩ̂z/dt = P (s₁v₂ − s₂v₁)",
        "Ω̃ is skew, so tr{Ω̃ (v sᵀ + s vᵀ)} ≡ 0: the printed law moves only a symmetric part and leaves Ω̂z at "
        "0.95 Ωz forever.",
        ("controller.rate_law",),
        runs=seen.rate_law,
    ),
    Erratum(
        "(16) → (17)",
        "d/dt D^(α−1) e = D^α e, with the Caputo derivative (7)",
        "d/dt D^(α−1) e is the Riemann-Liouville derivative; it exceeds Caputo's by e(0) t^(−α)/Γ(1−α)",
        "Differentiate the integral. With the Riemann-Liouville derivative the equivalent control cancels exactly.",
        ("controller.derivative",),
        runs=seen.derivative,
    ),
    Erratum(
        "(33), (46)",
        "inside the layer −(s/δ²) ‖s‖ ρ",
        "−(s/δ) ρ, the usual layer",
        "The printed one has no gain at s = 0, where s then wanders.",
        ("controller.layer",),
        runs=seen.layer,
    ),
    Erratum("(1)", "second line begins with m ẍ", "m ÿ; the cross term is m ΩxΩy", "Dimensions."),
    Erratum(
        "(1), assumptions",
        "rotations only about x and y; centrifugal forces are negligible",
        "rotation about z as well; (1) has the centrifugal forces, (2) neglects them",
        "Ωz is the rate to be sensed, and the terms in Ωy² + Ωz², Ωx² + Ωz² and ΩxΩy are the centrifugal forces.",
        ("plant.centrifugal",),
        identity=identities.centrifugal_terms,
    ),
    Erratum("(8)", "∫ e⁻ᵗ t^(c−1) dt", "the same; c is the argument of Γ", "Not the exponent c of (16)."),
    Erratum("(11)", "|K| ≤ b₁, |D| ≤ b₂", "‖ΔK‖ ≤ b₁, ‖ΔD‖ ≤ b₂", "Only so does (12) follow from (10)."),
    Erratum(
        "(11)–(12), section 5",
        "a bounded disturbance, f = randn",
        "white noise of density S held for h has variance S/h, and no bound",
        "A Gaussian exceeds every bound; its power depends on the hold time, which the paper does not state.",
        ("disturbance.hold", "disturbance.density"),
        runs=seen.gaussian,
    ),
    Erratum(
        "(15), before (16)",
        "e^(q/p) with odd p, q may not be real for e < 0, hence (16)",
        "it is real, |e|^(q/p) sign(e)",
        "An odd root of a negative number is real. (16) only frees the exponent c from being a ratio of odd numbers.",
        identity=identities.odd_roots,
    ),
    Erratum(
        "(16), abstract, section 6",
        "D^(α−1) e is a “fractional-order differentiation term”",
        "the fractional integral of order 1 − α",
        "α − 1 < 0 for 0 < α < 1.",
        identity=identities.order_of_a_constant,
    ),
    Erratum(
        "(17), (18), contribution 3",
        "continuous control inputs",
        "|e|^(c−1) ė in the force is unbounded where e = 0, ė ≠ 0",
        "c − 1 < 0. Remark 1 leaves it to another surface, but the simulation has this one. A floor under |e| is ours.",
        ("controller.singularity_floor",),
        identity=identities.singular_term,
        runs=seen.singular_term,
    ),
    Erratum(
        "(18), (19)",
        "(18) requires f, which is unknown",
        "(18) does not contain f; it leaves ṡ = f",
        "Insert (18) in (17). The force for ṡ = 0, which would require f, is (18) less f.",
        identity=identities.equivalent_control,
    ),
    Erratum(
        "(22)–(25)",
        "ε = min(ρ − ‖f‖) > 0; t_r is the time to ṡ = 0; t_r ≤ √(2 (V(0) − V(t_r)))/ε",
        "ε ≥ 0; to s = 0; t_r ≤ (√V(0) − √V(t_r)) √2/ε",
        "(12) allows ‖f‖ = ρ, so that no time follows. The integral (24) is a difference of roots; both agree if "
        "V(t_r) = 0. (23) follows from the line ≤ −ε‖s‖ of (22), not from its last, which lacks a √2.",
        identity=identities.reaching_time,
    ),
    Erratum(
        "Remark 2, (26)–(32)",
        "on the fractional surface the error reaches zero at a finite time",
        "on a fractional surface it decays like a power of t; only the integer-order one is finite-time",
        "If e were zero from some t on, D^(α−1) e would still keep a tail of the past, so s could not stay "
        "zero. The proof bounds that tail by the present error.",
        runs=seen.tail,
    ),
    Erratum(
        "(27)–(32)",
        "e − ½ ė(t_r)(t − t_r) − e(t_r) = λ1 D^(α−2) e + D^(−1)(λ2 |e|^c sign(e) − C), and t_d from it",
        "e − ė(t_r)(t − t_r) − e(t_r) = −λ1 D^(−1){D^(α−1) e − (D^(α−1) e)(t_r)} − D^(−1)(λ2 |e|^c sign(e) − C), "
        "D^(−1) from t_r on",
        "D^(−2) D^(2) e has (t − t_r)/Γ(2), Γ(2) = 1; (28) lost the minus of (27), and both drop the memory at t_r. "
        "With it, all that is linear in t − t_r adds up to s(t_r) (t − t_r) = 0, so (31), (32) bound nothing. (31) "
        "assumes e = ė = 0 at t_d, which is to be proved; (32) divides by the vector ė(t_r), which may be 0.",
        identity=identities.second_integral,
        runs=seen.second_integral,
    ),
    Erratum("(40)", "K q in the second line", "K̃ q", "Insert (38)."),
    Erratum(
        "(43)–(45), (46)",
        "V̇ ≤ 0",
        "with (36) only. With (46) V̇ = sᵀf − ‖s‖ρ + ‖s‖ρ̂ (1 − ‖s‖²/δ²) inside the layer, which is positive for large ρ̂",
        "The proof treats (36), the simulation uses (46), and ρ̂ grows. With the usual layer the last factor is "
        "1 − ‖s‖/δ.",
        ("controller.layer_thickness",),
        identity=identities.layer_dissipation,
        runs=seen.layer_dissipation,
    ),
    Erratum(
        "Remark 4",
        "tracking error and surface converge to zero in finite time",
        "V̇ ≤ 0 and Barbalat's lemma give asymptotic convergence, and with a layer an ultimate bound",
        "(45) bounds ∫‖s‖ dt and no reaching time, since ε vanishes with the margin of b̂.",
        runs=seen.finite_time,
    ),
    Erratum(
        "(44)",
        "M, N any positive definite matrices",
        "multiples of the identity",
        "Transpose (44): otherwise D̂ and K̂ lose their symmetry. The scenario therefore takes numbers.",
        runs=seen.symmetry,
    ),
    Erratum(
        "(44), figure 19",
        "b̂ shows stable convergence",
        "b̂ grows without bound under noise",
        "‖s‖ ≥ 0 is integrated forever. Fixed by adaptation.leakage, .dead_zone or .projection, all off in both "
        "variants, since the paper has none.",
        ("adaptation.leakage", "adaptation.dead_zone", "adaptation.projection"),
        runs=seen.bound,
    ),
    Erratum(
        "(44), (46), sampled",
        "the closed loop is stable",
        "with a step h and the usual layer it is unstable from ρh/δ = 2 − λ₁h on, which b̂ reaches in noise",
        "A held force takes ρh/δ of s back in one step. No switch fixes the law (44) in either variant; "
        "controller.switching_limit, a field of ours, bounds ρh/δ.",
        ("controller.switching_limit",),
        runs=seen.end,
    ),
    Erratum(
        "Remark 5",
        "the resonance frequencies of x and y differ, which is persistent excitation; so (44) finds D, K, Ω",
        "the reference's frequencies differ; excitation is necessary, not sufficient",
        "Resonances belong to the plant, not to the reference. As printed, (44) cannot move Ω̂z, however it is excited; "
        "as corrected, layer, sampling and noise leave errors.",
        identity=identities.resonances,
        runs=seen.excitation,
    ),
    Erratum(
        "(47) → (48)",
        "ω0 = 1 kHz; time in s",
        "ω0 = 1000 rad/s; time in ms",
        "1 kHz is 6283 rad/s, with which (48) does not follow. The figures' “s” are units of 1/ω0.",
        ("plant.reference_frequency",),
        identity=identities.unit_of_frequency,
    ),
    Erratum(
        "Section 5",
        "results are plotted in Figures 3–16",
        "Figures 3–19",
        "The captions and the text continue to Figure 19.",
        identity=identities.last_figure,
    ),
    Erratum(
        "Table 1, its text",
        "the fractional controller is closer to the reference than the integer-order one",
        "only at some orders; which, depends on axis, time and reading",
        "Recomputed, since the values of Table 1 are not available: low orders are farther off than α = 1.",
        runs=seen.table,
    ),
)
