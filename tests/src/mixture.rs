//! A mixture of normal distributions: data whose ideal denoiser is known in closed form, and so the flow that samplers
//! solve.

use viewfuse::check::poses::Random;
use viewfuse::device::Device;
use viewfuse::field::FieldError;

/// Values of one datum: a picture has several data.
pub const DIMENSIONS: usize = 4;

/// Data are one of several centres plus normally distributed noise about it, the same in every direction.
#[derive(Clone, Debug)]
pub struct Mixture {
    components: Vec<Component>,
}

#[derive(Clone, Copy, Debug)]
struct Component {
    share: f64,
    centre: [f64; DIMENSIONS],
    deviation: f64,
}

impl Mixture {
    /// Components of these deviations, at random centres in `[-1, 1]`, more and less likely ones.
    pub fn new(seed: u32, deviations: &[f64]) -> Mixture {
        let mut random = Random::new(seed);
        let component = |deviation: &f64| Component {
            share: random.range(0.5, 1.5),
            centre: std::array::from_fn(|_| random.range(-1.0, 1.0)),
            deviation: *deviation,
        };
        Mixture { components: deviations.iter().map(component).collect() }
    }

    /// The ideal denoiser: the mean of the data that a noisy picture may come from.
    pub fn denoised(&self, noisy: &[f64], sigma: f64) -> Vec<f64> {
        noisy.chunks(DIMENSIONS).flat_map(|noisy| self.denoised_datum(noisy, sigma)).collect()
    }

    fn denoised_datum(&self, noisy: &[f64], sigma: f64) -> [f64; DIMENSIONS] {
        let likelihood = |component: &Component| {
            let variance = component.deviation * component.deviation + sigma * sigma;
            let squared: f64 = noisy.iter().zip(&component.centre).map(|(x, m)| (x - m) * (x - m)).sum();
            component.share.ln() - 0.5 * (squared / variance + DIMENSIONS as f64 * variance.ln())
        };
        let likelihoods: Vec<f64> = self.components.iter().map(likelihood).collect();
        let largest = likelihoods.iter().fold(f64::NEG_INFINITY, |largest, value| largest.max(*value));
        let mut sum = [0.0; DIMENSIONS];
        let mut total = 0.0;
        for (component, likelihood) in self.components.iter().zip(&likelihoods) {
            let weight = (likelihood - largest).exp();
            let variance = component.deviation * component.deviation;
            total += weight;
            for ((sum, x), m) in sum.iter_mut().zip(noisy).zip(&component.centre) {
                *sum += weight * (variance * x + sigma * sigma * m) / (variance + sigma * sigma);
            }
        }
        sum.map(|sum| sum / total)
    }

    /// The flow's solution at level `to` from a state at level `from`: Runge and Kutta's fourth-order steps in the
    /// logarithm of the level, so many that halving them changes nothing that matters here.
    pub fn solution(&self, state: &[f64], from: f64, to: f64, step_count: u32) -> Vec<f64> {
        let length = (to / from).ln() / f64::from(step_count);
        let slope = |x: &[f64], sigma: f64| -> Vec<f64> {
            x.iter().zip(self.denoised(x, sigma)).map(|(x, denoised)| x - denoised).collect()
        };
        let ahead = |x: &[f64], k: &[f64], share: f64| -> Vec<f64> {
            x.iter().zip(k).map(|(x, k)| x + share * length * k).collect()
        };
        let mut x = state.to_vec();
        for index in 0..step_count {
            let at = |share: f64| from * ((f64::from(index) + share) * length).exp();
            let a = slope(&x, at(0.0));
            let b = slope(&ahead(&x, &a, 0.5), at(0.5));
            let c = slope(&ahead(&x, &b, 0.5), at(0.5));
            let d = slope(&ahead(&x, &c, 1.0), at(1.0));
            for (index, x) in x.iter_mut().enumerate() {
                *x += length / 6.0 * (a[index] + 2.0 * b[index] + 2.0 * c[index] + d[index]);
            }
        }
        x
    }

    /// The denoiser as a device sees it: in `f64` on the host.
    ///
    /// # Errors
    /// If the device is lost.
    pub fn denoise<D: Device>(
        &self,
        device: &D,
        state: &D::Buffer<f32>,
        sigma: f32,
        denoised: &mut D::Buffer<f32>,
    ) -> Result<(), FieldError> {
        let noisy: Vec<f64> = device.download(state).map_err(FieldError::Device)?.into_iter().map(f64::from).collect();
        let values: Vec<f32> = self.denoised(&noisy, f64::from(sigma)).into_iter().map(|value| value as f32).collect();
        *denoised = device.upload(&values).map_err(FieldError::Device)?;
        Ok(())
    }
}

/// Root mean square of the difference of two pictures; NaN if one has a NaN.
pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    (a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>() / a.len() as f64).sqrt()
}
