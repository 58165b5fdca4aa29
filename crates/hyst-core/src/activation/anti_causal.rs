//! The anti-causal inverse, backwards in time, for α < 0.

use super::kind::ActivationKind;
use super::operator::Activation;
use crate::error::within;
use crate::stage::{hold, rest};
use crate::{Env, Error, Real, Stage};

/// Inverse of an [`Activation`] with α < 0, with preview: it computes the drive of time k from references up to time
/// k + [`lead`](Self::lead).
///
/// With a = |α|/h, `z_k = φ(u_k) − a (u_k − u_(k−1))` gives each drive from the next one,
///
/// ```text
/// u_(k−1) = u_k + (z_k − φ(u_k)) / a,      φ(u) = k₀ u + β f(γ u),
/// ```
///
/// Where |1 − φ′/a| < 1, an error of a future drive decays backwards in time. Each [`step`](Stage::step) starts at the
/// newest reference with the drive at rest. It computes backwards until it meets the planned drive of the previous
/// step, and keeps that plan from there on. At the meeting point the output of the model misses a reference by a times
/// the difference of the plans. Elsewhere the error is zero. [`backward`](Self::backward) inverts a whole record in one
/// pass.
///
/// # The switching range
/// With a steep activation (βγ ≫ k₀), φ′ reaches 2a near u = 0. For |u| within [`switching`](Self::switching) an error
/// decays less backwards in time, or grows. A drive that crosses or touches zero needs a plan that is settled on both
/// sides. `lead` is then twice the value that the tolerance needs elsewhere. The tolerance is kept if the drive stays
/// outside the range for half the lead between two visits. [`with_lead`](Self::with_lead) shortens the lead for drives
/// that never enter the range.
///
/// A plan starts at rest and differs from the drive by up to 1 + 2a/k₀ times the largest step of the drive (a = |α|/h).
/// A drive that is nearer than that to the switching range counts as one that enters it. A plan that starts in the
/// range leaves it by up to `chatter`. This error decays too, but not always within the lead.
///
/// A *reference* that stays between the two sides of the switching range (z between β min f and β max f) has no drive
/// that stays inside. Backwards in time the drive jumps between the sides, up to [`chatter`](Self::chatter) to either
/// side. In one pass, the model turns this drive into the reference exactly. Sample by sample, the plans never meet
/// there. They are joined where their difference is smallest, and the error is a fraction of |β|.
///
/// ```
/// use hyst_core::{Activation, ActivationKind, ActivationParams, AntiCausal, Build, Env, Sampling, Stage};
/// let params = ActivationParams { k0: 0.1516, alpha: -1.7e-4, beta: 0.1996, gamma: 1000.0 };
/// let model: Activation<f64> = (ActivationKind::Atan, params).build(&Sampling { period: 1e-3 })?;
/// let inverse: AntiCausal<f64, 64> = model.anti_causal(1e-9)?;
/// let reference = |k: usize| 3.0 + (0.06 * k as f64).sin();
/// let (mut forward, mut backward, e) = (model.state(), inverse.state(), Env::default());
/// inverse.reset(&mut backward, &e, reference(0));
/// for k in 1..500 {
///     let drive = inverse.step(&mut backward, &e, reference(k));
///     let Some(now) = k.checked_sub(inverse.lead()) else { continue };
///     let reached = if now == 0 { model.reset(&mut forward, &e, drive) } else { model.step(&mut forward, &e, drive) };
///     // The reference moves from its first sample; the model starts at rest.
///     assert!(now < 2 || (reached - reference(now)).abs() < 1e-9);
/// }
/// # Ok::<(), hyst_core::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AntiCausal<T, const N: usize> {
    forward: Activation<T>,
    /// 1/a
    scale: T,
    /// Plans meet when their difference has fallen to this share of its value at the newest reference.
    share: f64,
    lead: usize,
    contraction: f64,
    switching: f64,
    chatter: f64,
}

/// History of the inverse: ring buffers with one element per time j.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AntiCausalState<T, const N: usize> {
    /// Reference of time j.
    references: [T; N],
    /// Planned drive of time j − 1.
    plan: [T; N],
    /// Drive of time j − 1 in the plan that starts at the newest reference.
    trial: [T; N],
    newest: usize,
    /// Number of steps since the reset.
    age: usize,
    z: T,
}

impl<T: Real> Activation<T> {
    /// Builds the inverse backwards in time. Its `lead` keeps the error of the output within `tolerance` times the
    /// largest |α u̇| of the drive. `N` must be larger than `lead`. Without a switching range, the lead is about
    /// `ln(1/tolerance) |α|/k₀` at high sample rates.
    ///
    /// # Errors
    /// [`Error::NotInvertible`] if α ≥ 0, or if k₀ (softplus: also k₀ + βγ) is not positive or at least 2|α|/h: then
    /// use [`Invert`](crate::Invert). [`Error::Capacity`] if `N` is too small, [`Error::OutOfRange`] if the tolerance
    /// is not between 0 and 1.
    pub fn anti_causal<const N: usize>(&self, tolerance: f64) -> Result<AntiCausal<T, N>, Error> {
        within("tolerance", tolerance, tolerance > 0.0 && tolerance < 1.0, "between 0 and 1")?;
        let a = -self.rate.to_f64();
        if a.is_nan() || a <= 0.0 {
            return Err(Error::NotInvertible("activation: alpha is not negative; use the causal inverse"));
        }
        let (far, other) = self.asymptotic_slopes();
        let (flattest, steepest) = (far.at_most(other), far.at_least(other));
        if flattest.is_nan() || flattest <= 0.0 {
            return Err(Error::NotInvertible("activation: k0 (softplus: and k0 + beta gamma) must be positive"));
        }
        if steepest >= 2.0 * a {
            return Err(Error::NotInvertible(
                "activation: the sample period is 2 |alpha| / k0 or longer; use the causal inverse",
            ));
        }
        let inverse = |flattest: f64, contraction: f64| AntiCausal {
            forward: *self,
            scale: T::from_f64(1.0 / a),
            // If the drive changes by at most V per sample, the drive at rest changes by at most V (1 + 2a/φ′). An
            // error e of the drive gives an error of the output of at most (1 + contraction) a e.
            share: tolerance * flattest / ((flattest + 2.0 * a) * (1.0 + contraction)),
            lead: 0,
            contraction,
            switching: 0.0,
            chatter: 0.0,
        };
        // If the whole slope of the activation is within the limits, the contraction holds everywhere. It may need more
        // samples than there are.
        let k0 = self.k0.to_f64();
        let (down, up) = self.activation_slopes();
        let (least, most) = (flattest.at_most(k0 + down), steepest.at_least(k0 + up));
        let slowest = |least: f64, most: f64| (1.0 - least / a).abs().at_least((1.0 - most / a).abs());
        let everywhere = inverse(least, slowest(least, most));
        let settled = everywhere.settled();
        let switches = self.kind != ActivationKind::Softplus && up > down;
        if least > 0.0 && most < 2.0 * a && (settled < N || !switches) {
            return everywhere.with_lead(settled);
        }
        // Else the contraction holds outside the switching range. Its limit is where the contraction is a little weaker
        // than far away.
        let contraction = libm::pow(slowest(flattest, steepest), 0.9).at_least(0.1);
        let strength = (self.beta.to_f64() * self.gamma.to_f64()).abs();
        let limit = if up > 0.0 { a * (1.0 + contraction) - k0 } else { k0 - a * (1.0 - contraction) };
        let switching = self.kind.steep_until(limit / strength) / self.gamma.to_f64().abs();
        let (low, high) = self.kind.range();
        let width = self.beta.to_f64().abs() * (high - low) / a;
        let least = if down < 0.0 { flattest.at_most(a * (1.0 - contraction)) } else { flattest };
        let outside = inverse(least, contraction);
        let lead = outside.settled().saturating_mul(2);
        AntiCausal { switching, chatter: switching + width / (2.0 - k0 / a).at_most(1.0), ..outside }.with_lead(lead)
    }
}

impl<T: Real, const N: usize> AntiCausal<T, N> {
    /// Returns the inverse with another preview, at least one sample.
    ///
    /// # Errors
    /// [`Error::Capacity`] unless `lead` is less than `N`.
    pub fn with_lead(self, lead: usize) -> Result<Self, Error> {
        if lead < N {
            Ok(Self { lead: lead.max(1), ..self })
        } else {
            Err(Error::Capacity { name: "references of the preview", needed: lead.saturating_add(1), holds: N })
        }
    }

    /// Returns the number of samples after which plans have met, outside the switching range.
    fn settled(&self) -> usize {
        let needed = libm::log(self.share) / libm::log(self.contraction.at_least(f64::MIN_POSITIVE));
        // NaN or negative if there is no contraction.
        if (0.0..1e9).contains(&needed) { libm::ceil(needed) as usize + 1 } else { usize::MAX }
    }

    /// Returns the number of samples by which the reference must be known in advance.
    pub fn lead(&self) -> usize {
        self.lead
    }

    /// Returns the maximum factor by which an error of the drive changes per sample backwards in time, outside
    /// [`switching`](Self::switching).
    pub fn contraction(&self) -> f64 {
        self.contraction
    }

    /// Returns the |u| within which errors decay less or not at all \[u\]; 0 if there is no such range.
    pub fn switching(&self) -> f64 {
        self.switching
    }

    /// Returns the largest |u| of a drive whose reference stays in the switching range \[u\]; 0 if there is no such
    /// range. For k₀ ≤ a it is |β| (max f − min f) h / |α| beyond `switching`.
    pub fn chatter(&self) -> f64 {
        self.chatter
    }

    /// Computes the drive for a whole record in one pass from its end, after which the reference is constant. Stops at
    /// the end of the shorter slice. Returns the drive one sample before the first. A model at rest there reaches every
    /// reference exactly, inside and outside the switching range. A non-finite reference is replaced by the one after
    /// it.
    pub fn backward(&self, references: &[T], drive: &mut [T]) -> T {
        let mut later = None;
        let mut u = T::ZERO;
        for (z, slot) in references.iter().zip(drive).rev() {
            let z = if z.is_finite() { *z } else { later.unwrap_or(T::ZERO) };
            if later.is_none() {
                u = self.forward.solve(self.forward.k0, z);
            }
            later = Some(z);
            *slot = u;
            u = self.before(u, z);
        }
        u
    }

    /// Returns the drive one sample before the drive `u` with output `z`.
    #[inline]
    fn before(&self, u: T, z: T) -> T {
        u + self.scale * (z - self.forward.at_rest(u))
    }
}

/// Iterates over a ring from the newest element backwards.
fn backwards<T, const N: usize>(ring: &[T; N], newest: usize) -> impl Iterator<Item = &T> {
    let (new, old) = ring.split_at(newest.saturating_add(1).min(N));
    new.iter().rev().chain(old.iter().rev())
}

/// Iterates mutably over a ring from the newest element backwards.
fn backwards_mut<T, const N: usize>(ring: &mut [T; N], newest: usize) -> impl Iterator<Item = &mut T> {
    let (new, old) = ring.split_at_mut(newest.saturating_add(1).min(N));
    new.iter_mut().rev().chain(old.iter_mut().rev())
}

impl<T: Real, const N: usize> Stage<T> for AntiCausal<T, N> {
    type State = AntiCausalState<T, N>;

    fn state(&self) -> Self::State {
        AntiCausalState {
            references: [T::ZERO; N],
            plan: [T::ZERO; N],
            trial: [T::ZERO; N],
            newest: 0,
            age: 0,
            z: T::ZERO,
        }
    }

    /// Sets the history to a reference that was always `u0`.
    fn reset(&self, s: &mut Self::State, _: &Env<T>, u0: T) -> T {
        *s = self.state();
        let z = rest(&mut s.z, u0);
        let u = self.forward.solve(self.forward.k0, z);
        s.references = [z; N];
        s.plan = [u; N];
        u
    }

    /// Takes the reference of time k + lead and returns the drive of time k, with at most lead + 100 evaluations of f.
    /// A non-finite reference is replaced by the last finite one.
    fn step(&self, s: &mut Self::State, _: &Env<T>, u: T) -> T {
        let z = hold(&mut s.z, u);
        s.newest = if s.newest + 1 < N { s.newest + 1 } else { 0 };
        // The drive at rest is also the drive one sample before: at rest nothing changes.
        let far = self.forward.solve(self.forward.k0, z);
        for (ring, value) in [(&mut s.references, z), (&mut s.plan, far), (&mut s.trial, far)] {
            if let Some(slot) = ring.get_mut(s.newest) {
                *slot = value;
            }
        }
        s.age = s.age.saturating_add(1);
        // From this place on, times are at or before the reset. The reference is not followed there, so any difference
        // of the plans is allowed.
        let past = if s.age <= self.lead { s.age } else { 1 };
        let mut drive = far;
        let (mut tolerance, mut least, mut meeting) = (None, T::ZERO, self.lead);
        let places = backwards(&s.references, s.newest).zip(backwards(&s.plan, s.newest));
        let places = places.zip(backwards_mut(&mut s.trial, s.newest)).enumerate();
        for (place, ((z, planned), trial)) in places.skip(1).take(self.lead) {
            drive = self.before(drive, *z);
            *trial = drive;
            let difference = (drive - *planned).abs();
            if place == past || (place > past && difference <= least) {
                (least, meeting) = (difference, place);
            }
            // Plans that differ only by rounding also meet.
            let tolerance = *tolerance.get_or_insert(difference * T::from_f64(self.share));
            if difference <= tolerance.at_least((T::EPSILON + T::EPSILON) * drive.abs()) {
                meeting = place;
                break;
            }
        }
        let plan = backwards_mut(&mut s.plan, s.newest).zip(backwards(&s.trial, s.newest));
        plan.take(meeting).for_each(|(planned, trial)| *planned = *trial);
        // The drive of time k is at the place of time k + 1.
        backwards(&s.plan, s.newest).nth(self.lead.saturating_sub(1)).map_or(far, |u| *u)
    }
}
