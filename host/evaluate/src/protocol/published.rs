//! Published figures for a benchmark, to be shown next to a table of the same protocol.
//!
//! They are means over all scenes of the benchmark, as the papers report them, with *fixed* sources far apart. Figures
//! of networks that choose the nearest sources for every target are another task and are not here. Some could not be
//! reproduced by others (LLFF with 3 sources: reported 21.35, ten reruns 20.34 ± 0.19; DTU with 3: reported 19.21,
//! rerun 17.86): they rank a field, but differences of tenths of a decibel are not significant.

use super::Protocol;
use super::benchmark::Benchmark;
use serde::Serialize;

/// A method's mean PSNR on a benchmark.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Figure {
    /// The method.
    pub method: &'static str,
    /// What it needs in addition to the sources; empty if nothing.
    pub needs: &'static str,
    /// Mean PSNR in decibels over the benchmark's scenes.
    pub psnr: f64,
}

/// A method: its name, what it needs, its figures by number of sources.
type Method = (&'static str, &'static str, &'static [(usize, f64)]);

const DIFFUSION: &str = "a diffusion prior";
const STEREO: &str = "points from dense stereo";

/// LLFF at 504x378, full metric, 8 scenes. mip-NeRF (Barron 2021) and RegNeRF (Niemeyer 2022) from RegNeRF; FreeNeRF
/// (Yang 2023); DNGaussian (Li 2024); 3DGS (Kerbl 2023) from stereo as in later comparisons; FrugalNeRF (Lin 2024);
/// FSGS (Zhu 2024); CoR-GS (Zhang 2024); DropGaussian (Park 2025); Binocular3DGS (Han 2024); ICO-GS; ReconFusion (Wu
/// 2024); CAT3D (Gao 2024); See3D (Ma 2025).
const LLFF: [Method; 14] = [
    ("mip-NeRF", "", &[(3, 16.11)]),
    ("RegNeRF", "", &[(3, 19.08)]),
    ("DNGaussian", "", &[(3, 19.12)]),
    ("3DGS", STEREO, &[(3, 19.22), (6, 23.80), (9, 25.44)]),
    ("FreeNeRF", "", &[(3, 19.63), (6, 23.73), (9, 25.13)]),
    ("FrugalNeRF", "", &[(3, 19.66)]),
    ("FSGS", "", &[(3, 20.43), (6, 24.09), (9, 25.31)]),
    ("CoR-GS", "", &[(3, 20.45), (6, 24.49), (9, 26.06)]),
    ("DropGaussian", "", &[(3, 20.76)]),
    ("ReconFusion", DIFFUSION, &[(3, 21.34)]),
    ("Binocular3DGS", "", &[(3, 21.44)]),
    ("CAT3D", DIFFUSION, &[(3, 21.58)]),
    ("ICO-GS", "", &[(3, 22.20)]),
    ("See3D", DIFFUSION, &[(3, 23.23)]),
];

/// DTU at 400x300, masked metric, 15 scenes, no masks for the methods. As above; NexusGS (Zheng 2025), MuRF (Xu 2024)
/// and SparseSurf.
const DTU: [Method; 11] = [
    ("3DGS", "", &[(3, 17.65)]),
    ("RegNeRF", "", &[(3, 18.89), (6, 22.20), (9, 24.93)]),
    ("CoR-GS", "", &[(3, 19.21)]),
    ("FreeNeRF", "", &[(3, 19.92)]),
    ("NexusGS", "", &[(3, 20.21)]),
    ("Binocular3DGS", "", &[(3, 20.71)]),
    ("ReconFusion", DIFFUSION, &[(3, 20.74)]),
    ("SparseSurf", "", &[(3, 21.31)]),
    ("MuRF", "", &[(3, 21.31)]),
    ("CAT3D", DIFFUSION, &[(3, 22.02)]),
    ("See3D", DIFFUSION, &[(3, 28.04)]),
];

/// NeRF-synthetic at 400x400, full metric, 8 scenes: FreeNeRF (Yang 2023), DNGaussian (Li 2024).
const BLENDER: [Method; 2] = [("FreeNeRF", "", &[(8, 24.26)]), ("DNGaussian", "", &[(8, 24.31)])];

/// Published figures with their conditions.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Published {
    /// Their conditions, in words: benchmark, sources, size, metric, and over which scenes the means are.
    pub of: String,
    /// The figures, ascending; none where the pictures were not made under the same protocol.
    pub figures: Vec<Figure>,
    /// Why there are no figures.
    pub withheld: Option<String>,
}

impl Published {
    /// What was published for a protocol; `None` for a protocol without published figures. They are withheld where the
    /// pictures have another size than the papers', where a scene lacks some of their views, where the field is given
    /// masks that the papers' methods are not, or where their metric was not computed. `scenes` are the names of the
    /// scenes that were evaluated, `sizes` those of their pictures, `targets` how many there are of each, `has_masked`
    /// whether the masked metric was computed.
    pub fn of(
        protocol: &Protocol,
        scenes: &[String],
        sizes: &[[u32; 2]],
        targets: &[usize],
        has_masked: bool,
    ) -> Option<Published> {
        let Protocol::Benchmark { benchmark, sources, masks_given } = protocol else { return None };
        let methods: &[Method] = match benchmark {
            Benchmark::Llff => &LLFF,
            Benchmark::Dtu => &DTU,
            Benchmark::Blender => &BLENDER,
        };
        let figure = |(method, needs, figures): &Method| {
            let psnr = figures.iter().find(|(count, _)| count == sources).map(|(_, psnr)| *psnr)?;
            Some(Figure { method, needs, psnr })
        };
        let mut figures: Vec<Figure> = methods.iter().filter_map(figure).collect();
        if figures.is_empty() {
            return None;
        }
        figures.sort_by(|a, b| a.psnr.total_cmp(&b.psnr));
        let [width, height] = benchmark.published_size();
        let withheld = if let Some([own_width, own_height]) = sizes.iter().find(|size| **size != [width, height]) {
            Some(format!("they are at {width}x{height}, these pictures at {own_width}x{own_height}"))
        } else if let Some((count, (have, name))) = benchmark.target_count().and_then(|count| {
            let mut scenes = targets.iter().zip(scenes);
            Some((count, scenes.find(|(have, _)| **have < count)?))
        }) {
            Some(format!("they are of {count} views a scene, and {name} has {have} of these"))
        } else if *masks_given {
            Some("their methods are given no masks".to_owned())
        } else if benchmark.is_masked() && !has_masked {
            Some("they are of the masked metric, and these photographs have no masks".to_owned())
        } else {
            None
        };
        let here = scenes.iter().filter(|name| benchmark.has_scene(name)).count();
        let metric = if benchmark.is_masked() { "PSNR masked" } else { "PSNR" };
        let of = format!(
            "{}, {sources} sources, {width}x{height}, {metric}: means over the benchmark's {} scenes ({}), {here} of \
             the {} here among them",
            benchmark.title(),
            benchmark.scenes().len(),
            benchmark.scenes().join(", "),
            scenes.len(),
        );
        Some(Published { of, figures: if withheld.is_some() { Vec::new() } else { figures }, withheld })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn published(protocol: &str, size: [u32; 2], has_masked: bool) -> Option<Published> {
        let protocol = protocol.parse().expect("a protocol");
        Published::of(&protocol, &["fern".to_owned(), "cup".to_owned()], &[size], &[25, 25], has_masked)
    }

    #[test]
    fn only_beside_the_same_protocol() {
        let same = published("llff:3", [504, 378], false).expect("figures");
        assert!(same.figures.len() == 14 && same.withheld.is_none(), "{same:?}");
        assert!(same.figures.is_sorted_by(|a, b| a.psnr <= b.psnr));
        assert!(same.of.starts_with("LLFF, 3 sources, 504x378, PSNR: means over the benchmark's 8 scenes (fern, "));
        assert!(same.of.ends_with(", 1 of the 2 here among them"), "{}", same.of);
        assert_eq!(published("llff:6", [504, 378], false).map(|row| row.figures.len()), Some(4));
        let small = published("llff:3", [252, 189], false).expect("withheld");
        assert_eq!(
            (small.figures.len(), small.withheld.as_deref()),
            (0, Some("they are at 504x378, these pictures at 252x189"))
        );
        assert_eq!(published("llff:4", [504, 378], false), None);
        // A part of the views has another mean.
        let dtu = |targets: usize| {
            let protocol = "dtu:3".parse().expect("a protocol");
            Published::of(&protocol, &["scan8".to_owned()], &[[400, 300]], &[targets], true).expect("figures")
        };
        assert!(dtu(25).withheld.is_none() && !dtu(25).figures.is_empty());
        assert_eq!(dtu(8).withheld.as_deref(), Some("they are of 25 views a scene, and scan8 has 8 of these"));
        assert!(dtu(8).figures.is_empty());
        assert_eq!(published("nearest:3", [504, 378], false), None);
    }

    #[test]
    fn masked_figures_need_the_masked_metric() {
        let withheld = |protocol, masked| published(protocol, [400, 300], masked).and_then(|row| row.withheld);
        assert_eq!(withheld("dtu:3", true), None);
        assert!(withheld("dtu:3", false).is_some_and(|why| why.contains("no masks")));
        assert!(withheld("dtu:3,masks=given", true).is_some_and(|why| why.contains("given no masks")));
        assert_eq!(published("blender:8", [400, 400], false).map(|row| row.figures.len()), Some(2));
    }
}
