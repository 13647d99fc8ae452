//! What `bits.c` prints, computed by calls of core.

use viewfuse::check::poses::Random;
use viewfuse_core::attention::{FourierEmbedding, cross_attention};
use viewfuse_core::composite::Compositor;
use viewfuse_core::fuse::fuse_views;
use viewfuse_core::pose::Pose;
use viewfuse_core::schedule::{HeunStep, NoiseSchedule, Preconditioning};
use viewfuse_core::sources::Sources;
use viewfuse_core::weighting::{AngleKind, Scheme, weigh};
use viewfuse_core::weights::Weights;

const SOURCES: usize = 32;
const CHANNELS: usize = 16;
const SAMPLES: usize = 64;
const VALUES: usize = 48;

/// The numbers that the program reads, in this order.
pub(crate) struct Inputs {
    parameters: Vec<f32>,
    pub(crate) sources: [[f32; 16]; SOURCES],
    target: [f32; 16],
    latents: [[f32; CHANNELS]; SOURCES],
    samples: [[f32; 5]; SAMPLES],
    background: [f32; 3],
    noisy: [f32; VALUES],
    outputs: [[f32; VALUES]; 2],
}

fn rows(flat: &[f32; 16]) -> [[f32; 4]; 4] {
    std::array::from_fn(|row| std::array::from_fn(|column| flat[4 * row + column]))
}

fn pose(flat: &[f32; 16]) -> Pose {
    Pose::from_opencv(&rows(flat)).unwrap_or_else(|error| panic!("{error}"))
}

impl Inputs {
    pub(crate) fn new() -> Inputs {
        let mut random = Random::new(71);
        let pose = |random: &mut Random| {
            let matrix = random.pose(1.5).to_opencv();
            std::array::from_fn(|entry| matrix[entry / 4][entry % 4])
        };
        let numbers = |random: &mut Random| random.normal() as f32;
        Inputs {
            parameters: (0..FourierEmbedding::PARAMETERS).map(|_| 0.2 * numbers(&mut random)).collect(),
            sources: std::array::from_fn(|_| pose(&mut random)),
            target: pose(&mut random),
            latents: std::array::from_fn(|_| std::array::from_fn(|_| numbers(&mut random))),
            // Thin, thick, empty and impossible samples at increasing depths.
            samples: std::array::from_fn(|index| {
                let thickness = random.log_range(1.0e-4, 0.3) as f32;
                let optical_depth = [thickness, -1.0, thickness, 0.0, thickness][index % 5];
                let [red, green, blue] = [0; 3].map(|_| random.unit() as f32);
                [red, green, blue, optical_depth, 1.0 + index as f32 / 16.0]
            }),
            background: [0.25, 0.5, 1.0],
            noisy: std::array::from_fn(|_| 80.0 * numbers(&mut random)),
            outputs: std::array::from_fn(|_| std::array::from_fn(|_| numbers(&mut random))),
        }
    }

    /// As bits, one number after the other.
    pub(crate) fn hexadecimal(&self) -> String {
        let all = self
            .parameters
            .iter()
            .chain(self.sources.as_flattened())
            .chain(&self.target)
            .chain(self.latents.as_flattened())
            .chain(self.samples.as_flattened())
            .chain(&self.background)
            .chain(&self.noisy)
            .chain(self.outputs.as_flattened());
        all.map(|number| format!("{:08x}\n", number.to_bits())).collect()
    }

    /// Poses of three sources and of the target as bits, one number after the other, and the bits of the weights that
    /// attention gives the sources.
    pub(crate) fn attended(&self, embedding: &FourierEmbedding) -> (String, Vec<u32>) {
        let poses = self.sources[..3].as_flattened().iter().chain(&self.target);
        let weights = cross_attention(embedding, &self.sources_up_to::<8>(3), &pose(&self.target));
        let bits = weights.values()[..3].iter().map(|weight| weight.to_bits()).collect();
        (poses.map(|number| format!("{:08x}\n", number.to_bits())).collect(), bits)
    }

    /// Name and bits of every line.
    pub(crate) fn expected(&self) -> Vec<(String, Vec<u32>)> {
        let mut lines = Lines::default();
        self.up_to::<8>(&mut lines, [1, 3, 8]);
        self.up_to::<16>(&mut lines, [2, 9, 16]);
        self.up_to::<32>(&mut lines, [5, 17, 32]);
        let weights = weigh(Scheme::ERROR, &self.sources_up_to::<SOURCES>(SOURCES), &pose(&self.target));
        lines.add("weigh", weights.values());
        lines.add("fuse", &fuse_views(&weights, &self.latents));
        self.composite(&mut lines);
        self.denoise(&mut lines);
        lines.0
    }

    fn sources_up_to<const S: usize>(&self, count: usize) -> Sources<S> {
        let poses: Vec<Pose> = self.sources[..count].iter().map(pose).collect();
        Sources::new(&poses).unwrap_or_else(|error| panic!("{error}"))
    }

    fn up_to<const S: usize>(&self, lines: &mut Lines, counts: [usize; 3]) {
        let checked = |scheme: Result<Scheme, _>| scheme.unwrap_or(Scheme::MEAN);
        let schemes = [
            Scheme::MEAN,
            checked(Scheme::gaussian(0.75)),
            checked(Scheme::distance(1)),
            checked(Scheme::distance(2)),
            checked(Scheme::distance(3)),
            Scheme::ERROR,
            checked(Scheme::error(0.25, AngleKind::PrincipalAxis)),
            checked(Scheme::error(0.5, AngleKind::FullRotation)),
            Scheme::L1,
            Scheme::FROBENIUS,
            Scheme::RELATIVE_FROBENIUS,
        ];
        let target = pose(&self.target);
        let embedding = FourierEmbedding::from_flat(&self.parameters);
        let latents: [[f32; CHANNELS]; S] = std::array::from_fn(|view| self.latents[view]);
        for count in counts {
            let sources = self.sources_up_to::<S>(count);
            for scheme in schemes {
                lines.weights("weigh", &weigh(scheme, &sources, &target));
            }
            let weights = cross_attention(&embedding, &sources, &target);
            lines.weights("attend", &weights);
            lines.add("fuse", &fuse_views(&weights, &latents));
        }
    }

    fn composite(&self, lines: &mut Lines) {
        for is_solid in [false, true] {
            let mut ray = Compositor::<3>::START;
            for [red, green, blue, thickness, depth] in self.samples {
                let rgb = [red, green, blue];
                if is_solid {
                    ray.add_solid(&rgb, thickness, depth)
                } else {
                    ray.add(&rgb, thickness, depth)
                };
                lines.add("ray", &[ray.transmittance()]);
            }
            let pixel = ray.finish(&self.background, 9.0);
            lines.add("rgb", &pixel.channels);
            lines.add("depth", &[pixel.depth]);
            lines.add("opacity", &[pixel.opacity]);
        }
    }

    fn denoise(&self, lines: &mut Lines) {
        let schedule = NoiseSchedule::published();
        for count in [1, 2, 5, 25] {
            let mut picture = self.noisy;
            for index in 0..count {
                let [sigma, next] = [index, index + 1].map(|index| schedule.level(index, count));
                lines.add("levels", &[sigma, next]);
                let factors = Preconditioning::at(sigma);
                lines.add("noise", &[factors.noise]);
                lines.add("input", &picture.map(|noisy| factors.network_input(noisy)));
                let step = HeunStep::between(sigma, next);
                for (value, network) in picture.iter_mut().zip(self.outputs[0].iter().zip(&self.outputs[1])) {
                    let denoised = factors.denoised(*value, *network.0);
                    *value = step.euler(*value, denoised);
                    if step.is_corrected() {
                        let there = Preconditioning::at(next).denoised(*value, *network.1);
                        *value = step.correct(*value, denoised, there);
                    }
                }
                lines.add("picture", &picture);
            }
        }
    }
}

#[derive(Default)]
struct Lines(Vec<(String, Vec<u32>)>);

impl Lines {
    fn add(&mut self, name: &str, numbers: &[f32]) {
        self.0.push((name.to_owned(), numbers.iter().map(|number| number.to_bits()).collect()));
    }

    fn weights<const S: usize>(&mut self, name: &str, weights: &Weights<S>) {
        self.add(name, &weights.values()[..weights.count() as usize]);
    }
}
