//! The comments in a C header about each stage: its equation with the names of its constants, and the layout of its
//! lists.

/// Returns the comment about a stage, by its name in the file. `u` is its input, `y` its output, `h` the sample period.
pub(super) fn of_stage(name: &str) -> &'static [&'static str] {
    match name {
        "delay" => &["y(t) = u(t - seconds)"],
        "rate" => &[
            "o(x) = volts (|x| / reference_rate)^exponent sgn(x); law follows: v = u - o(du/dt)",
            "holds: v <- max(u - |o(du/dt)|, min(u + |o(du/dt)|, v)); relaxes: u - v = o(dv/dt), one implicit Euler step per sample",
        ],
        "lag" => &["seconds dy/dt + y = u"],
        "pi" => &[
            "y = gain u + sum over i of weights[i] play[i]",
            "play[i] <- max(u - thresholds[i], min(u + thresholds[i], play[i])), 0 before the first input; thresholds increase",
        ],
        "rate-dependence" => &[
            "drag of the play operators of pi: if o = |u - play[i]| - thresholds[i] > 0, play[i] moves towards u at the speed v with",
            "seconds v + sqrt(volt_seconds v) = o; in one sample it moves by h v, (seconds + h) v + sqrt(volt_seconds v) = o",
        ],
        "gpi" => &[
            "y = gain F(0) + sum over i of weights[i] F(thresholds[i])",
            "F(r) <- max(left(u) - r, min(right(u) + r, F(r))), 0 before the first input; thresholds increase",
            "left, right: linear is slope u + offset, tanh is height tanh(rate u + shift) + offset",
        ],
        "td-pi" => &[
            "y = sum over i = 0 .. plays of p(i) F(alpha i), p(i) = epsilon exp(eta (T - reference_degc)) exp(-tau alpha i)",
            "F(r) <- max(a0 u + a1 - r, min(b0 u + b1 + r, F(r))), 0 before the first input",
        ],
        "maxwell-slip" => &[
            "y = sum over i of gains[i] element[i]; widths increase",
            "backlash: element[i] is the play with half-width widths[i] / 2; elasto-slip: u minus the play with half-width widths[i]",
        ],
        "td-em" => &[
            "i = sum over k of slip_gains[k] element[k] (backlash: the play with half-width slip_widths[k] / 2), a current",
            "i charges capacitance || resistance to a voltage v, and mass x'' + damping x' + stiffness x = psi v; y = per_metre x",
            "psi = coupling[0] + coupling[1] T + coupling[2] T^2, T in degC",
        ],
        "preisach" => &[
            "relays switch up at alpha and down at beta <= alpha; the grid divides low .. high into cells intervals for each",
            "density[a (a + 1) / 2 + b]: output of the relays with alpha in interval a and beta in interval b <= a, counted from 0",
            "once[a]: output of the relays with alpha in interval a that never switch back; rest: input of the initial state",
            "y is 0 at rest and is interpolated between the nodes of the grid",
        ],
        "dpm" => &[
            "each branch of preisach is multiplied by xi(rate |du/dt|, change of the input since its start), bilinear between nodes",
            "preisach_density[a (a + 1) / 2 + b]: relays with alpha in interval a and beta in interval b <= a of the grid, from 0;",
            "preisach_once[a]: relays with alpha in interval a that never switch back; preisach_rest: input of the initial state",
            "mirror_weights[d mirror_changes + p]: xi at node d of rate_low .. rate_high and node p of change_low .. change_high",
            "fade: travel over which the jump at a closing loop decays to 1/e; 0 keeps the jump",
        ],
        "bouc-wen" => {
            &["y = k0 u + g, dg = alpha du - beta |du| |g|^(n-1) g - gamma du |g|^n, g = 0 before the first input"]
        }
        "bouc-wen-oscillator" => &[
            "mass y'' + damping y' + stiffness y + z = u",
            "z' = alpha y' - beta (gamma |y'| |z|^(nu-1) z + delta y' |z|^nu)",
        ],
        "lfdm" => &["Y(s) = (a + b s^alpha) / (1 + c s^beta) U(s); order: accuracy of the sampled derivatives"],
        "ifm" => &[
            "Y(s) = delta U(s) + (a + b s^alpha) / (1 + c s^beta) (e^(-tau s) - 1) U(s)",
            "order: accuracy of the sampled derivatives",
        ],
        "atan" => &["y = k0 u + alpha du/dt + beta atan(gamma u)"],
        "sigmoid" => &["y = k0 u + alpha du/dt + beta / (1 + exp(-gamma u))"],
        "softplus" => &["y = k0 u + alpha du/dt + beta ln(1 + exp(gamma u))"],
        "softsign" => &["y = k0 u + alpha du/dt + beta gamma u / (1 + |gamma u|)"],
        "tanh" => &["y = k0 u + alpha du/dt + beta tanh(gamma u)"],
        "asymmetry" => &[
            "y = u + sum over j of weights[j] d[j]; d[j] = max(u - thresholds[j], 0) if thresholds[j] >= 0, else min(u - thresholds[j], 0)",
            "side: output, the curve is after the hysteresis; input, it is before the hysteresis",
        ],
        "temperature" => &[
            "y = v (1 + per_kelvin x) + direct u x + expansion x, u the drive and v the output of the hysteresis,",
            "seconds dx/dt = T - reference_degc - x, T the measured temperature",
        ],
        "creep" => &["y = u + sum over i of shares[i] x[i], seconds[i] dx[i]/dt = u - x[i], x[i] = u at rest"],
        "load" => &["y = u (1 + gain_per_newton F) + per_newton F, F the measured load"],
        "resonance" => &["y = (1 - gain) u + gain x, x'' = w^2 (u - x) - 2 damping w x', w = 2 pi hz"],
        "saturation" => &[
            "w = knee (high - low); y = u from low + w to high - w; beyond, y = k + (L - k) tanh((u - k) / (L - k)), L = low or high, k = L +- w",
            "side: output, the limits are those of the motion; input, they are those of the drive",
        ],
        "drift" => &[
            "y = u + per_second t + settling (1 - exp(-(t - since_s) / seconds)) from since_s on, t the time; seconds 0: no settling",
        ],
        "interference" => &[
            "y = u + amplitude sin(2 pi hz t + phase) + sum of a_k sin(2 pi k hz t) + b_k cos(2 pi k hz t), k = 2 to 5, t the time",
            "harmonics: a_2, b_2, a_3, b_3, a_4, b_4, a_5, b_5",
        ],
        _ => &[],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Kind;

    #[test]
    fn every_kind_is_described_and_the_layout_of_the_triangle_is_right() {
        for kind in Kind::ALL {
            assert!(!of_stage(kind.name()).is_empty(), "{kind}");
        }
        // The place that the comment states.
        assert_eq!(hyst_core::preisach_cell(5, 3), 5 * (5 + 1) / 2 + 3);
    }
}
