"""By which formula each number of a report comes about, with its source: each formula is written here, and once.

The paper is R. Xu, Q. Chen, G. Yang, H. Yan, "Identification of a certain mechanism's recoiling mass by limited memory
least square method", Journal of Vibroengineering, 2013. a is the acceleration of the recoiling part, F the force on
it, m its mass, k the number of a sample.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

from recoil_rigs.tables.rig_tables import FORCE_SENSOR_ROLES, GAUGE_ROLES

MOTION = ("recoil_acceleration", *FORCE_SENSOR_ROLES)
OF_FORCES = ("bore_area", "brake_area", "recuperator_area", "friction", "bore_friction")
EQUATION_36 = "equation (36) of the paper, m3 a' = P - R_f"


@dataclass(frozen=True)
class Formula:
    """How a number comes about.

    Attributes
    ----------
    text
        The formula, or the step in words where it is none.
    source
        The equation of the paper, the standard or the publication.
    inputs
        Key paths of the report that enter it.
    roles
        Roles of the channels of the shot file that enter it.
    rig
        Values of the rig's table ``[mechanism]`` that enter it.
    """

    text: str
    source: str
    inputs: tuple[str, ...] = ()
    roles: tuple[str, ...] = ()
    rig: tuple[str, ...] = ()


_BY_FILTER = ("filter.mass_cutoff_hz", "filter.half_order", "interval_s")
_SCALES = "each restricted by the certificate of its sensor"
_AVERAGED = "; the mean over all shapes that no rig states and none, each as likely as the shot makes it"
_MASSES: Mapping[str, Formula] = {
    "calibrated": Formula(
        "m = m0 e^mu, with mu and the sensors' errors by least squares of a = e^(al - mu) [sum_j F_j e^-g_j + R - df s]"
        " / m0 + b + v d + S z, " + _SCALES + _AVERAGED,
        f"{EQUATION_36}, with its sensors' errors as unknowns; generalized least squares, the certificates as "
        "observations",
        _BY_FILTER, (*MOTION, "recoil_displacement"), OF_FORCES,
    ),
    "camera": Formula(
        "m = m0 e^mu, with mu and the sensors' errors by least squares of the camera's frames on the double integral "
        "of the forces over m, " + _SCALES + _AVERAGED,
        f"{EQUATION_36}, integrated twice; generalized least squares, the certificates as observations",
        ("interval_s",), ("recoil_displacement", *FORCE_SENSOR_ROLES), OF_FORCES,
    ),
    "reverse": Formula(
        "1/m = sum a F / sum F^2, both behind one low-pass", f"least squares of {EQUATION_36}: acceleration on force",
        _BY_FILTER, MOTION, OF_FORCES,
    ),
    "forward": Formula(
        "m = sum a F / sum a^2, both behind one low-pass", f"least squares of {EQUATION_36}: force on acceleration",
        _BY_FILTER, MOTION, OF_FORCES,
    ),
    "paper": Formula(
        "m = sum a F / sum a^2, unfiltered",
        "equations (32) to (36) of the paper, with na = nb = d = 0", ("interval_s",), MOTION, OF_FORCES,
    ),
    "kinematic": Formula(
        "1/m = sum a F / sum F^2, with a from the camera's displacement", f"least squares of {EQUATION_36}",
        ("filter.half_order", "interval_s"), ("recoil_displacement", *FORCE_SENSOR_ROLES), OF_FORCES,
    ),
    "tls": Formula(
        "total least squares of F = m a, with the ratio of the noises known from the baseline",
        "W. E. Deming, Statistical Adjustment of Data, 1943", _BY_FILTER, MOTION, OF_FORCES,
    ),
}  # fmt: skip
_CERTIFICATE = "the certificate in the rig file, taken as it is (type B: JCGM 100:2008, 4.3)"
_U_OF_ROWS = Formula(
    "u = m times the standard deviation of mu that the errors of the rows, as they correlate, leave",
    "statistics of the residuals (type A: JCGM 100:2008, 4.2)", ("provenance.parameters.rows",),
)  # fmt: skip
_BAARDA = "W. Baarda, A testing procedure for use in geodetic networks, 1968: internal and external reliability"
_CLOCK = "t_ref = (1 + drift) t_source + offset_s"
_PEAK = "largest value from the onset of force to the end of recoil travel"
_TAKEN_OFF = "without what the fit found of its sensors' scales and zeros"
_FUSED = "A. W. Smyth and M. Wu, Mech. Syst. Signal Process. 21(2), 2007: camera and accelerometer together"
_STUDENT = ("uncertainty.coverage_factor", "uncertainty.degrees_of_freedom")
_EDGES = (
    "H. Theil, Nederl. Akad. Wetensch. Proc. 53, 1950, and P. K. Sen, J. Amer. Statist. Assoc. 63, 1968; "
    "then least squares"
)
_ALIGNED: Mapping[str, Formula] = {
    "motion": Formula(
        f"{_CLOCK}, the likeliest for z_i = k D((1 + gamma) t_i + tau) + c0 + c1 t_i + c2 t_i^2 / 2 + w_i + n_i",
        "A. W. Smyth and M. Wu, Mech. Syst. Signal Process. 21(2), 2007, with the clock's offset as a parameter",
        (), ("recoil_displacement", "recoil_acceleration"),
    ),
    "redundant": Formula(
        f"{_CLOCK}, by least squares of y_i = g r(t_i + shift + drift (t_i - origin)) + c, both behind one low-pass",
        "Gauss-Newton; u by J. G. MacKinnon and H. White, J. Econometrics 29(3), 1985, and W. K. Newey and K. D. West, "
        "Econometrica 55(3), 1987",
    ),
    "trigger": Formula(
        f"{_CLOCK}, a line through the instants of edges that both recorders saw",
        _EDGES,
    ),
    "force": Formula(
        f"{_CLOCK}, the likeliest for the camera's frames on the double integral of the forces over a mass left open",
        "A. W. Smyth and M. Wu, Mech. Syst. Signal Process. 21(2), 2007, with the clock's offset as a parameter",
        (), ("recoil_displacement", *FORCE_SENSOR_ROLES), OF_FORCES,
    ),
    "exposure": Formula(
        f"{_CLOCK}, a line through the pulses of the camera's exposures",
        _EDGES,
    ),
    "absolute": Formula(
        f"{_CLOCK}, the absolute time at the source's zero less that at the reference clock's",
        "the starts of both recorders, and what their clocks are locked to",
    ),
    "fixed": Formula(f"{_CLOCK}, as the rig file states it", "the rig file"),
}  # fmt: skip
_TABLE: tuple[tuple[str, Formula], ...] = (
    ("mass.u", Formula("u = sqrt(sum of u_i^2 over the budget)", "JCGM 100:2008 (GUM), equation (10)", ("budget",))),
    ("mass.U95", Formula("m - k u to m + k u, k of Student's t",
                         "JCGM 100:2008 (GUM), G.3.2", ("mass.value", "mass.u", *_STUDENT))),
    ("mass.U_kg", Formula("k u, k of Student's t", "JCGM 100:2008 (GUM), G.3.2", ("mass.u", *_STUDENT))),
    ("mass.u_all_read", Formula("u with the share and the force that no gauge reads held at what the rig states",
                                "the fit of the mass", ("mass.u", "budget"))),
    ("mass.u_specification", Formula("sqrt(u_m3^2 + u_added_mass^2 + u_carried_mass^2)",
                                     "the rig file and the shot log", ("shot_log.u_added_mass_kg",), (),
                                     ("m3", "carried_mass"))),
    ("mass.specification", Formula("m3 + added mass + carried_mass", "the rig file and the shot log",
                                   ("shot_log.added_mass_kg",), (), ("m3", "carried_mass"))),
    ("mass.specification_of.*", Formula("a part of the specification", "the rig file and the shot log",
                                        ("shot_log.added_mass_kg", "shot_log.u_added_mass_kg"), (),
                                        ("m3", "carried_mass"))),
    ("rpe_percent.value", Formula(
        "RPE = sum |m_true - m(k)| / sum |m_true| * 100 %, over the identified samples k of the interval",
        "equation (37) of the paper; m(k) by limited memory least squares of the last window_s, its equations (32) to "
        "(35)", ("mass.specification", "window_s", "interval_s", "identified_share"))),
    ("rpe_percent.U95", Formula(
        "shortest interval that holds 95 % of the drawn RPEs", "JCGM 101:2008, 5.3.4",
        ("rpe_percent.value", "mass.u", "provenance.parameters.seeds.rpe"))),
    ("E_n", Formula("E_n = (m - m_spec) / (2 sqrt(u^2 + u_spec^2))", "ISO/IEC 17043, annex B",
                    ("mass.value", "mass.u", "mass.specification", "mass.u_specification"))),
    ("mass.E_n", Formula("E_n = (m - m_spec) / (2 sqrt(u^2 + u_spec^2))", "ISO/IEC 17043, annex B",
                         ("mass.value", "mass.u", "mass.specification", "mass.u_specification"))),
    ("mass.deviation_kg", Formula("m - m_spec", "definition", ("mass.value", "mass.specification"))),
    ("mass.deviation_percent", Formula("100 (m / m_spec - 1)", "definition", ("mass.value", "mass.specification"))),
    ("conformity.tolerance_kg", Formula("tolerance_kg", "[report] of the rig file, or the header file")),
    ("conformity.limits_kg", Formula("m_spec + tolerance_kg", "definition",
                                     ("mass.specification", "conformity.tolerance_kg"))),
    ("conformity.deviation_kg", Formula("m - m_spec", "definition", ("mass.value", "mass.specification"))),
    ("conformity.rule", Formula("decision_rule, 0.95 if left out", "[report] of the rig file, or the header file")),
    ("conformity.word", Formula(
        "simple: conforms if T_L <= d <= T_U; guard band: conforms if d keeps U from both limits, does not if it lies "
        "further than U beyond one; a probability: conforms from it on, does not from 1 less it down",
        "ILAC-G8:09/2019, 4.2; JCGM 106:2012, 8",
        ("conformity.rule", "conformity.probability", "conformity.tolerance_kg", "conformity.deviation_kg"))),
    ("conformity.guard_band_kg", Formula("U = k u", "ILAC-G8:09/2019, 4.2.2: w = U", ("conformity.u_kg",))),
    ("conformity.probability", Formula(
        "F((T_U - d) / u) - F((T_L - d) / u), F the distribution of the mass", "JCGM 106:2012, section 7",
        ("conformity.tolerance_kg", "conformity.deviation_kg", "conformity.u_kg"))),
    ("conformity.u_kg", Formula("sqrt(u^2 + u_added^2 + u_carried^2)", "JCGM 100:2008 (GUM), equation (10)",
                                ("mass.u", "mass.specification_of"))),
    ("quantities.*.conformity.probability", Formula(
        "F((T_U - d) / u) - F((T_L - d) / u), F the normal distribution", "JCGM 106:2012, section 7")),
    ("quantities.*.conformity.u_kg", Formula("sqrt(u^2 + u_added^2 + u_carried^2)",
                                             "JCGM 100:2008 (GUM), equation (10)")),
    ("budget.random errors of this shot.u_kg", _U_OF_ROWS),
    ("budget.*.u_kg", Formula("u_i = |sensitivity| u_source", "JCGM 100:2008 (GUM), 5.1.3")),
    ("budget.*.estimate", Formula("pull of the source in standard uncertainties, times u_source",
                                  "the fit of the mass", ("sensors",))),
    ("budget.*.sensitivity_kg", Formula("change of the mass if the source is off by one sensitivity_per",
                                        "JCGM 100:2008 (GUM), 5.1.3: c_i = df/dx_i")),
    ("budget.*_pressure sensitivity and area.u_source", Formula(
        "sqrt(u_rel^2 + (u_area / area)^2)", _CERTIFICATE, (), GAUGE_ROLES, OF_FORCES[:3])),
    ("budget.*dynamic scale.u_source", Formula(
        "0.005 of a breech gauge whose certificate is not stated as dynamic",
        "Metrologia 55 (2018) S52: the best standard of such pulses has U 1.5 %", (), ("breech_pressure",))),
    ("budget.packing friction.u_source", Formula("u_friction", _CERTIFICATE, (), (), ("friction",))),
    ("budget.recoil_acceleration sensitivity.u_source", Formula("u_rel", _CERTIFICATE, (), ("recoil_acceleration",))),
    ("budget.camera scale.u_source", Formula("u_rel", _CERTIFICATE, (), ("recoil_displacement",))),
    ("budget.* of the camera's picture.u_source", Formula(
        "u_distortion_m, half of it for the S", _CERTIFICATE, (), ("recoil_displacement",))),
    ("budget.*zero that moves*.u_source", Formula("u_zero_rel of the range, or of the peak", _CERTIFICATE)),
    ("budget.alignment of clock *.u_source", Formula("u of the clock's offset", "the alignment of this shot",
                                                     ("alignment",))),
    ("budget.*zero.u_source", Formula("standard uncertainty of the mean of the baseline before the shot",
                                      "statistics (type A: JCGM 100:2008, 4.2)", ("baseline",))),
    ("budget.*zero.degrees_of_freedom", Formula(
        "n - 1, of n samples of the baseline before the shot; infinite where no baseline told it",
        "JCGM 100:2008 (GUM), G.3.2 and G.4.2", ("baseline",))),
    ("budget.random errors of the shots.degrees_of_freedom", Formula(
        "2 (v / u(v))^2, v the variance of what is random, u(v) its spread over scatters; infinite where they agree",
        "JCGM 100:2008 (GUM), G.3", ("repeatability",))),
    ("budget.random errors of this shot.degrees_of_freedom", _U_OF_ROWS),
    ("budget.*.degrees_of_freedom", Formula(
        "1 / (2 r^2), r = 0.25 the share to which the u is known of what the rig does not state; nu of a certificate",
        "JCGM 100:2008 (GUM), G.4.2")),
    ("peaks.*_pressure_pa", Formula(
        f"{_PEAK} of a polynomial of degree 4 through the samples above 95 % of it, {_TAKEN_OFF}",
        "the channel of the shot file", ("interval_s", "sensors"), GAUGE_ROLES)),
    ("peaks.recoil_acceleration_m_s2", Formula(f"{_PEAK} of |a|, behind the low-pass, {_TAKEN_OFF}",
                                               "the channel of the shot file",
                                               ("interval_s", "filter.cutoff_hz", "filter.half_order", "sensors"),
                                               ("recoil_acceleration",))),
    ("peaks.recoil_velocity_m_s", Formula(f"{_PEAK} of the velocity behind the low-pass, {_TAKEN_OFF}", _FUSED,
                                          ("interval_s", "filter.cutoff_hz", "filter.half_order", "sensors"),
                                          ("recoil_acceleration", "recoil_displacement"))),
    ("peaks.recoil_travel_m", Formula(f"{_PEAK} of the travel, {_TAKEN_OFF}", _FUSED, ("interval_s", "sensors"),
                                      ("recoil_acceleration", "recoil_displacement"))),
    ("peaks.recoil_time_s", Formula(
        f"t1 - t0 - v(t1) / a(t1), t0 half a sample before the identification interval begins and t1 its end, v "
        f"{_TAKEN_OFF}", _FUSED,
        ("interval_s", "sensors"))),
    ("peaks.impulse_n_s", Formula(f"sum of P dt, P the force that drives, {_TAKEN_OFF}",
                                  "the first force of equation (36) of the paper", ("interval_s", "sensors"),
                                  ("breech_pressure", "driving_force"), ("bore_area", "bore_friction"))),
    ("peaks_u.*", Formula(
        "sqrt(J S J' + u_o^2): J the derivatives by the unknowns of the fit, S their covariance, u_o of what it does "
        "not hold: noise of the samples, and what camera and accelerometer leave of one another",
        "JCGM 102:2011, 6.2", ("sensors", "correlations"))),
    ("peaks_u_shared.*", Formula(
        "part of u by what every shot of the same sensors, or of the same rig, has in common",
        "JCGM 100:2008 (GUM), 5.2.4", ("peaks_u",))),
    ("peaks_degrees_of_freedom.*", Formula(
        "u^4 / sum(u_i^4 / nu_i), u_i the parts of u", "JCGM 100:2008 (GUM), (G.2b)", ("peaks_u",))),
    ("peaks_U95.*", Formula(
        "value -+ k u, k the 97.5 % quantile of Student's t", "JCGM 100:2008 (GUM), G.3.2",
        ("peaks", "peaks_u", "peaks_degrees_of_freedom"))),
    ("uncertainty.degrees_of_freedom", Formula("u^4 / sum(u_i^4 / nu_i)", "JCGM 100:2008 (GUM), (G.2b)", ("budget",))),
    ("uncertainty.coverage_factor", Formula("97.5 % quantile of Student's t", "JCGM 100:2008 (GUM), G.3.2",
                                            ("uncertainty.degrees_of_freedom",))),
    ("uncertainty.U_kg", Formula("half the width of the interval: U = k u", "JCGM 100:2008 (GUM), 6.2.1, or JCGM "
                                 "101:2008, 8.2, as uncertainty.interval_by says", ("mass.U95",))),
    ("uncertainty.frisch_bracket_kg", Formula("sum a F / sum a^2 to sum F^2 / sum a F", "R. Frisch, 1934")),
    ("uncertainty.monte_carlo.*", Formula(
        "propagation of distributions, in blocks of draws until the results stand to the tolerance",
        "JCGM 101:2008, 7.9, 5.3.3, 5.3.4 and 8.1", ("provenance.parameters.seeds.monte_carlo",))),
    ("constancy.likeliest_sensor.gain", Formula(
        "half the square of the largest normalised residual of a sensor",
        "W. Baarda, A testing procedure for use in geodetic networks, 1968")),
    ("constancy.gain", Formula(
        "half the square of the drift's normalised residual, or of the step's less what many instants find by chance",
        "C. R. Rao, Proc. Camb. Phil. Soc. 44, 1948")),
    ("constancy.ln_bayes_factor", Formula(
        "ln of the probability of the rows if the mass drifts, 3 % over the travel, or steps by 2 % at one of 24 "
        "instants, over that if it is constant; forces that no gauge reads are in both",
        "R. E. Kass and A. E. Raftery, J. Amer. Statist. Assoc. 90, 1995")),
    ("constancy.could_hide_percent.*", Formula(
        "size of a drift over the travel, or of a step in its middle, of which ln_bayes_factor is above 3 in 19 draws "
        "of the rows' errors of 20",
        "R. E. Kass and A. E. Raftery, J. Amer. Statist. Assoc. 90, 1995")),
    ("constancy.*", Formula(
        "score tests of a drift and of a step of the mass", "C. R. Rao, Proc. Camb. Phil. Soc. 44, 1948; D. W. K. "
        "Andrews, Econometrica 61(4), 1993; B. E. Hansen, J. Econometrics 97(1), 2000",
        ("provenance.parameters.seeds.constancy",))),
    ("agreement.*probability", Formula(
        "probability of chi-square, with these degrees of freedom, of at least the misfit",
        "K. Pearson, Phil. Mag. 50, 1900; for several results of one quantity R. T. Birge, Phys. Rev. 40, 1932")),
    ("agreement.*factor", Formula(
        "sqrt(misfit / degrees_of_freedom) where the probability is below the limit, else 1",
        "R. T. Birge, Phys. Rev. 40, 1932")),
    ("agreement.*", Formula(
        "sum of squares of what the joint fit leaves of the rows: of those about changes of the mass within a shot, or "
        "of all others and of what was known beforehand",
        "G. J. Bierman, Factorization Methods for Discrete Sequential Estimation, 1977", ("common", "repeatability"))),
    ("gauges.*", Formula(
        "sum of what a gauge's force is off by: certificate, pulse, standard, area, friction in the bore",
        "the joint fit of all shots", ("common", "repeatability"))),
    ("breech_chain.*", Formula(
        "score tests of a bent breech gauge, of one ahead of the breech face, of a muzzle brake, of a tube's swing, of "
        "a part that hangs elastically and of amplifiers that droop, each at several values of what nobody states",
        "C. R. Rao, Proc. Camb. Phil. Soc. 44, 1948; R. E. Kass and A. E. Raftery, J. Amer. Statist. Assoc. 90, 1995; "
        "J. A. Hoeting et al., Statistical Science 14(4), 1999")),
    ("mass_over_time.*", Formula(
        "m(t) as a random walk of 12 pieces, 3 % over the travel, estimated with all sensors' errors",
        "equation (36), generalized least squares")),
    ("endogeneity.*", Formula("force on acceleration, with and without an instrument", "Durbin-Wu-Hausman test")),
    ("sensors.*.normalised_residual", Formula(
        "pull over its own standard deviation", "W. Baarda, A testing procedure for use in geodetic networks, 1968")),
    ("could_hide.*.largest_error", Formula(
        "4.13 / sqrt(c' C^-1 (C - A S A') C^-1 c): C of the certificates, A their rows, S the covariance of the "
        "unknowns, c an error of one; 4.13 is told in four shots of five", _BAARDA)),
    ("could_hide.*.mass_kg", Formula("largest_error times sensitivity_kg", _BAARDA)),
    ("could_hide.*.sensitivity_kg", Formula("-m S A' C^-1 c, of the mass's logarithm", _BAARDA)),
    ("campaign.*", Formula(
        "what the shot says of what shots share: |R (x - reference) - y|^2",
        "G. J. Bierman, Factorization Methods for Discrete Sequential Estimation, 1977")),
    ("filter.mass_cutoff_hz", Formula(
        "of the fit of the mass: below it the force has 99 % of its energy, of several shots the middle one's",
        "the spectrum of the force")),
    ("filter.cutoff_hz", Formula(
        "of the mass over time, RPE and peaks: filter.spectra_hz, at most a fifth of the rate of the slowest force",
        "N. Wiener, 1949, within zero-phase Butterworth filters", ("filter.spectra_hz",))),
    ("filter.*_hz", Formula("where motion lost and ringing left over are least together",
                            "N. Wiener, 1949, within zero-phase Butterworth filters")),
    ("fusion.*", Formula("z_i = k D(t_i) + c0 + c1 t_i + c2 t_i^2 / 2 + w(t_i) + n_i", _FUSED)),
    ("interval_s", Formula("from the onset of force to the end of recoil travel", "the shot's own signals")),
    ("identified_share", Formula("identified samples over all samples of the interval", "the trace, mass.csv")),
)  # fmt: skip


_OF_SHOTS = Formula(
    "least squares of the rows of all shots and of what is known of what they share, each once, averaged over scatters "
    "of gains and friction by their likelihood",
    "A. Gelman et al., Bayesian Data Analysis, 3rd edition 2013, section 13.1",
    ("common", "repeatability"),
)
"""The mass of a campaign."""
_PEAKS_OF_SHOTS = {
    "value": Formula("sum of the shots' values over their number", "JCGM 100:2008 (GUM), 4.2.1", ("shots",)),
    "scatter": Formula("standard deviation of the shots' values", "JCGM 100:2008 (GUM), 4.2.2", ("shots",)),
    "u": Formula(
        "sqrt(s^2 / n + u_c^2): s the scatter, or what the shots' own u leaves if that is larger, u_c the part of "
        "u that they share", "JCGM 100:2008 (GUM), 4.2.3 and 5.2.4", ("shots",)),
    "U95": Formula("value -+ coverage_factor u", "JCGM 100:2008 (GUM), 6.2.1"),
    "degrees_of_freedom": Formula("u^4 / ((s^2 / n)^2 / (n - 1))", "JCGM 100:2008 (GUM), (G.2b)"),
    "coverage_factor": Formula("97.5 % quantile of Student's t", "JCGM 100:2008 (GUM), G.3.2"),
}  # fmt: skip
"""The quantities of a campaign's shots."""
_FACTOR_OF_SHOTS = Formula(
    "97.5 % quantile of Student's t for the degrees of freedom of what is known beforehand; u is averaged over the "
    "scatters that the shots allow",
    "JCGM 100:2008 (GUM), G.3.2 and G.4.2; A. Gelman et al., Bayesian Data Analysis, 3rd edition 2013, section 13.1",
    ("uncertainty.degrees_of_freedom", "repeatability"),
)  # fmt: skip
"""The coverage factor of a campaign's interval, which has the uncertainty of the scatters in its u."""
_FREEDOM_OF_SHOTS = Formula(
    "u^4 / sum(u_i^4 / nu_i) over what is known beforehand: what is random is averaged over its scatters",
    "JCGM 100:2008 (GUM), (G.2b)", ("budget",),
)  # fmt: skip
"""The degrees of freedom of a campaign's u."""


def formula_of(key: str, document: Mapping[str, Any]) -> Formula | None:
    """Return the formula of a number of a report; None for what is no result of one.

    Parameters
    ----------
    key
        Key path of the number, without quotes and without places in arrays.
    """
    parts = key.split(".")
    if key == "mass.value":
        return _OF_SHOTS if "shots" in document else _MASSES.get(document["mass"]["method"])
    if key == "uncertainty.coverage_factor" and "shots" in document:
        return _FACTOR_OF_SHOTS
    if key == "uncertainty.degrees_of_freedom" and "shots" in document:
        return _FREEDOM_OF_SHOTS
    if parts[0] == "peaks" and "shots" in document:
        return _PEAKS_OF_SHOTS.get(parts[-1])
    if parts[0] == "methods" and parts[-1] == "mass_kg":
        return _MASSES.get(".".join(parts[1:-1]))
    if parts[0] == "alignment" and parts[-1] in ("offset_s", "u_offset_s", "drift", "u_drift"):
        clock = ".".join(parts[1:-1])
        method = next((row.get("method") for row in document["alignment"] if row.get("clock") == clock), None)
        return _ALIGNED.get(str(method))
    return next((formula for pattern, formula in _TABLE if fnmatchcase(key, pattern)), None)
