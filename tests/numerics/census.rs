//! The CPU's own census beside the body, for any greys: the same bits.

use viewfuse::check::swept::{Swept, band};
use viewfuse::check::world::Numbers;
use viewfuse::device::Device;
use viewfuse::device::cpu::Cpu;
use viewfuse_kernels::bodies;
use viewfuse_kernels::plane_sweep::evidence::UNSEEN;
use viewfuse_kernels::plane_sweep::frustum::FrustumBlock;
use viewfuse_kernels::plane_sweep::{PLANES, Planes};

/// Groups of planes of all pixels together.
const GROUPS: u32 = 600;
const SEEDS: u64 = 12;

fn bits(planes: &[Planes]) -> Vec<u32> {
    planes.iter().flatten().map(|value| value.to_bits()).collect()
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
    let mut parts = vec![none; costs.len()];
    Cpu.census_cost(frustum, part, row_count - part, pairs, grey, evidence, &mut parts).expect("the CPU computes");
    assert_eq!(bits(&parts), bits(&costs), "{what}");
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
