//! Sums over bands of frequency, 48 to an octave, with their neighbours.

use nalgebra::Complex;

/// Bands in an octave.
const PER_OCTAVE: f64 = 48.0;

/// How far neighbours count: standard deviation of their weight \[bands\].
#[derive(Clone, Copy, Debug)]
pub(super) enum Width {
    /// A mode of little damping is no broader.
    Narrow,
    /// A sixth of an octave.
    Medium,
    /// Half an octave: what is about the same there, as a level of noise.
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

/// Which band each frequency is in.
pub(super) struct Bands {
    of_bin: Vec<usize>,
    count: usize,
}

impl Bands {
    pub(super) fn new(bins: usize) -> Self {
        let band = |bin: usize| (PER_OCTAVE * (bin.max(1) as f64).log2()).round() as usize;
        Self { of_bin: (0..bins).map(band).collect(), count: band(bins.max(1) - 1) + 1 }
    }

    /// Sum over the frequencies of each band, its neighbours included by their weights.
    pub(super) fn sums(&self, width: Width, value: impl Fn(usize) -> Complex<f64>) -> Vec<Complex<f64>> {
        let mut own = vec![Complex::new(0.0, 0.0); self.count];
        // A mean is no frequency.
        self.of_bin.iter().enumerate().skip(1).for_each(|(bin, band)| own[*band] += value(bin));
        let reach = (4.0 * width.bands()).ceil() as usize;
        let weights: Vec<f64> = (0..=reach).map(|away| (-0.5 * (away as f64 / width.bands()).powi(2)).exp()).collect();
        let smooth = |band: usize| {
            let others = band.saturating_sub(reach)..(band + reach + 1).min(self.count);
            others.map(|other| own[other] * weights[other.abs_diff(band)]).sum()
        };
        (0..self.count).map(smooth).collect()
    }

    /// The same of real values.
    pub(super) fn real_sums(&self, width: Width, value: impl Fn(usize) -> f64) -> Vec<f64> {
        self.sums(width, |bin| Complex::new(value(bin), 0.0)).into_iter().map(|sum| sum.re).collect()
    }

    pub(super) fn of(&self, bin: usize) -> usize {
        self.of_bin[bin]
    }
}
