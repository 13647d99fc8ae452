//! Files of Gaussians.

use super::{OneFile, Target, Verdict, verdict};
use viewfuse::scene::SceneFrame;
use viewfuse::scene::gaussians::{Gaussian, GaussianScene, MAX_LOGARITHM};
use viewfuse_core::gaussian::REST_COUNTS;

pub(crate) struct Gaussians(pub(super) OneFile);

impl Target for Gaussians {
    fn seeds(&self) -> Vec<Vec<u8>> {
        let gaussian = Gaussian {
            position: [0.5, -1.0, 2.0],
            log_scales: [-3.0, -2.0, -4.0],
            rotation: [1.0, 0.0, 0.5, 0.0],
            opacity: 1.0,
            f_dc: [0.25, 0.5, 0.75],
        };
        let seed = |degree: u32| {
            let f_rest = vec![0.125; 2 * 3 * REST_COUNTS[degree as usize] as usize];
            let path = self.0.path.with_extension("seed");
            let scene = GaussianScene { gaussians: vec![gaussian; 2], degree, f_rest, is_antialiased: false };
            scene.write(&path, &SceneFrame::FILE).expect("a file");
            std::fs::read(&path).expect("a file")
        };
        vec![seed(0), seed(1)]
    }

    fn words(&self) -> &'static [&'static str] {
        &[
            "property float ", "property list uchar int ", "element vertex ", "double", "uchar", "end_header\n",
            "f_rest_9", "-1", "4294967296",
        ]
    }

    fn run(&mut self, bytes: &[u8]) -> Result<Verdict, String> {
        let path = self.0.write(bytes);
        let outcome = GaussianScene::read(path, &SceneFrame::FILE);
        if let Ok(GaussianScene { gaussians, degree, f_rest, .. }) = &outcome {
            if f_rest.len() != gaussians.len() * 3 * REST_COUNTS[*degree as usize] as usize {
                return Err(format!(
                    "{} Gaussians of degree {degree} have {} coefficients",
                    gaussians.len(),
                    f_rest.len()
                ));
            }
            let is_whole = |gaussian: &Gaussian| {
                let limited =
                    gaussian.log_scales.iter().chain([&gaussian.opacity]).all(|value| value.abs() <= MAX_LOGARITHM);
                let finite = gaussian
                    .position
                    .iter()
                    .chain(&gaussian.rotation)
                    .chain(&gaussian.f_dc)
                    .all(|value| value.is_finite());
                limited && finite
            };
            if let Some(wrong) = gaussians.iter().find(|gaussian| !is_whole(gaussian)) {
                return Err(format!("{wrong:?} was read"));
            }
        }
        verdict(outcome, path)
    }
}
