//! Sums over frequency bands, 48 per octave, with their neighbours.

use nalgebra::Complex;

/// Bands per octave.
const PER_OCTAVE: f64 = 48.0;

/// Standard deviation of the weights of neighbouring bands \[bands\].
#[derive(Clone, Copy, Debug)]
pub(super) enum Width {
    /// As narrow as a lightly damped mode.
    Narrow,
    /// A sixth of an octave.
    Medium,
    /// Half an octave, for smooth quantities like the level of noise.
    Wide,
}

impl Width {
    fn bands(self) -> f64 {
        match self {
            Self::Narrow => 0.7,
            Self::Medium => 8.0,
            Self::Wide => 24.0,
        }
    }
}

/// Band of each frequency.
pub(super) struct Bands {
    of_bin: Vec<usize>,
    count: usize,
}

impl Bands {
    pub(super) fn new(bins: usize) -> Self {
        let band = |bin: usize| (PER_OCTAVE * (bin.max(1) as f64).log2()).round() as usize;
        Self { of_bin: (0..bins).map(band).collect(), count: band(bins.max(1) - 1) + 1 }
    }

    /// Returns the sum over the frequencies of each band and its weighted neighbours.
    pub(super) fn sums(&self, width: Width, value: impl Fn(usize) -> Complex<f64>) -> Vec<Complex<f64>> {
        let mut own = vec![Complex::new(0.0, 0.0); self.count];
        // Without the mean.
        self.of_bin.iter().enumerate().skip(1).for_each(|(bin, band)| own[*band] += value(bin));
        let reach = (4.0 * width.bands()).ceil() as usize;
        let weights: Vec<f64> =
            (0..=reach).map(|distance| (-0.5 * (distance as f64 / width.bands()).powi(2)).exp()).collect();
        let smooth = |band: usize| {
            let others = band.saturating_sub(reach)..(band + reach + 1).min(self.count);
            others.map(|other| own[other] * weights[other.abs_diff(band)]).sum()
        };
        (0..self.count).map(smooth).collect()
    }

    /// Returns the same for real values.
    pub(super) fn real_sums(&self, width: Width, value: impl Fn(usize) -> f64) -> Vec<f64> {
        self.sums(width, |bin| Complex::new(value(bin), 0.0)).into_iter().map(|sum| sum.re).collect()
    }

    pub(super) fn of(&self, bin: usize) -> usize {
        self.of_bin[bin]
    }
}
