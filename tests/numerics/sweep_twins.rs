//! The CPU's own loops of the plane sweep beside the bodies: the same bits.

use viewfuse::check::swept::{Swept, band};
use viewfuse::check::world::Numbers;
use viewfuse::device::Device;
use viewfuse::device::cpu::Cpu;
use viewfuse_kernels::bodies;
use viewfuse_kernels::plane_sweep::evidence::UNSEEN;
use viewfuse_kernels::plane_sweep::frustum::FrustumBlock;
use viewfuse_kernels::plane_sweep::window::WindowBlock;
use viewfuse_kernels::plane_sweep::{PLANES, Planes};

/// Groups of planes of all pixels together.
const GROUPS: u32 = 600;
const SEEDS: u64 = 12;

fn bits(planes: &[Planes]) -> Vec<u32> {
    planes.iter().flatten().map(|value| value.to_bits()).collect()
}

#[test]
fn views_are_compared_to_the_bit() {
    for seed in 0..SEEDS {
        let swept = Swept::new(seed, GROUPS);
        let len = swept.band_len();
        let Swept { frustum, views, pairs, texels, disparities } = swept;
        let none = [f32::NAN; PLANES];
        let (mut grey, mut evidence) = (vec![none; views.len() * len], vec![none; 4 * len]);
        for group in 0..len as u32 {
            let (views, texels, disparities) = (&views[..], &texels[..], &disparities[..]);
            bodies::compare_views(
                &frustum,
                views,
                &pairs,
                texels,
                disparities,
                &mut grey[..],
                &mut evidence[..],
                group,
            );
        }
        let (mut own_grey, mut own_evidence) = (vec![none; views.len() * len], vec![none; 4 * len]);
        Cpu.compare_views(&frustum, &views, &pairs, &texels, &disparities, &mut own_grey, &mut own_evidence)
            .expect("the CPU compares");
        assert_eq!(bits(&own_grey), bits(&grey), "grey of seed {seed}");
        assert_eq!(bits(&own_evidence), bits(&evidence), "evidence of seed {seed}");
    }
}

/// The census of a band: the loop of the CPU and the body.
fn assert_same_census(swept: &Swept, grey: &Vec<Planes>, evidence: &Vec<Planes>, what: &str) {
    let Swept { frustum, pairs, .. } = swept;
    let FrustumBlock { camera, first_row, row_count, group_count, .. } = *frustum;
    let none = [f32::NAN; PLANES];
    let row_len = camera.width * group_count;
    // In two parts: what a part does not compute stays.
    let part = row_count / 3;
    let mut costs = vec![none; 2 * ((first_row + row_count) * row_len) as usize];
    for group in part * row_len..row_count * row_len {
        bodies::census_cost(frustum, pairs, grey, evidence, &mut costs[..], group);
    }
    let mut own = vec![none; costs.len()];
    Cpu.census_cost(frustum, part, row_count - part, pairs, grey, evidence, &mut own).expect("the CPU computes");
    assert_eq!(bits(&own), bits(&costs), "{what}");
}

#[test]
fn the_census_is_the_same_to_the_bit() {
    for seed in 0..SEEDS {
        let swept = Swept::new(seed, GROUPS);
        let (grey, evidence) = band(&mut Numbers::new(seed), &swept);
        assert_same_census(&swept, &grey, &evidence, &format!("seed {seed}"));
    }
}

#[test]
fn the_census_of_any_greys_is_the_same_to_the_bit() {
    let extremes = [
        0.0,
        -0.0,
        f32::MIN_POSITIVE,
        1.0 / 1024.0,
        1.0,
        15.999,
        16.0,
        40.0,
        f32::MAX,
        f32::INFINITY,
        f32::NAN,
        UNSEEN,
        -1.0e30,
        f32::NEG_INFINITY,
    ];
    for seed in 0..SEEDS {
        let swept = Swept::new(seed, GROUPS);
        let numbers = &mut Numbers::new(seed);
        let (mut grey, evidence) = band(numbers, &swept);
        for grey in grey.as_flattened_mut().iter_mut().step_by(5) {
            *grey = extremes[numbers.between(0.0, extremes.len() as f32) as usize % extremes.len()];
        }
        assert_same_census(&swept, &grey, &evidence, &format!("seed {seed}"));
    }
}

#[test]
fn opacities_are_the_same_to_the_bit() {
    for seed in 0..SEEDS {
        let swept = Swept::new(seed, GROUPS);
        let volume = swept.volume();
        let Swept { frustum, views, disparities, .. } = swept;
        let count = (volume.width * volume.height * volume.group_count) as usize;
        let none = [f32::NAN; PLANES];
        let (mut opacities, mut own) = (vec![none; count], vec![none; count]);
        for group in 0..count as u32 {
            bodies::plane_opacity(&frustum, &views[..], &disparities[..], &mut opacities[..], group);
        }
        Cpu.plane_opacity(&frustum, &views, &disparities, &mut own).expect("the CPU computes");
        assert_eq!(bits(&own), bits(&opacities), "seed {seed}");
    }
}

#[test]
fn windows_are_summed_to_the_bit() {
    for seed in 0..SEEDS {
        let numbers = &mut Numbers::new(seed);
        // Images that are lower than a window, as high as one, and of several runs of rows; strips that end inside a row.
        let [width, height] = [8.0, 40.0].map(|most| numbers.between(1.0, most) as u32);
        let reach = [1.0, 5.0, 12.0].map(|most| numbers.between(1.0, most + 1.0) as u32);
        let group_count = 1 + seed as u32 % 5;
        let block = WindowBlock { width, height, group_count, reach, near_cost: 0.01, padding: 0 };
        let count = (width * height * group_count) as usize;
        let none = [f32::NAN; PLANES];
        let mut sums = vec![none; 6 * count];
        sums.iter_mut().flatten().for_each(|sum| *sum = numbers.between(0.0, 25.0));
        let (mut means, mut own) = (vec![none; count], vec![none; count]);
        for group in 0..count as u32 {
            bodies::window_cost(&block, &sums, &mut means[..], group);
        }
        Cpu.window_cost(&block, &sums, &mut own).expect("the CPU computes");
        assert_eq!(bits(&own), bits(&means), "seed {seed}: {block:?}");
    }
}
