//! A ray whose samples are interpolated between nodes, at which alone the network was evaluated.
//!
//! Along a ray a network is smooth: its highest frequency spans several samples. The samples of both passes lie where
//! the exact picture has them, so that their random places cost nothing; only their colours and densities are
//! interpolated.

use super::options::{MIN_OPACITY, Sampling};
use viewfuse_core::composite::{Composite, Compositor};
use viewfuse_core::depths::{CoarseBlock, FineBlock, PROBABILITY_FLOOR, coarse_depth, random_draw, stratified_depth};
use viewfuse_core::math::clamp;
use viewfuse_core::rays::TargetRay;

/// Rays with less transmittance than this show nothing more.
const MIN_TRANSMITTANCE: f32 = 1.0e-4;

/// The values of a ray at evenly spaced nodes.
pub(super) struct NodeRay<'a> {
    pub(super) ray: TargetRay,
    /// `[node]` of red, green, blue from 0 to 1, and density before it is rectified.
    pub(super) values: &'a [[f32; 4]],
}

impl NodeRay<'_> {
    /// Depth of a node.
    pub(super) fn depth(ray: &TargetRay, node: usize, count: usize) -> f32 {
        stratified_depth(ray.near, ray.far, node as u32, count as u32, 0.5)
    }

    /// Red, green, blue from 0 to 1 and the rectified density at a depth, by cubic polynomials, at the ends by straight
    /// lines.
    fn value(&self, depth: f32) -> [f32; 4] {
        let count = self.values.len();
        let place = (depth - self.ray.near) / (self.ray.far - self.ray.near) * count as f32 - 0.5;
        let left = clamp(place, 0.0, (count - 1) as f32) as usize;
        let right = (left + 1).min(count - 1);
        let share = clamp(place - left as f32, 0.0, 1.0);
        let (a, b) = (self.values[left], self.values[right]);
        let value = if left > 0 && right + 1 < count {
            let weights = cubic_weights(share);
            let (before, behind) = (self.values[left - 1], self.values[right + 1]);
            [0, 1, 2, 3].map(|channel| {
                let nodes = [before[channel], a[channel], b[channel], behind[channel]];
                weights.iter().zip(nodes).map(|(weight, node)| weight * node).sum()
            })
        } else {
            [0, 1, 2, 3].map(|channel| a[channel] + share * (b[channel] - a[channel]))
        };
        let [red, green, blue, density] = value;
        [clamp(red, 0.0, 1.0), clamp(green, 0.0, 1.0), clamp(blue, 0.0, 1.0), density.max(0.0)]
    }

    /// The pixel's colour and depth from both passes' samples.
    pub(super) fn composite(&self, pixel: u32, sampling: &Sampling, background: &[f32; 3]) -> Composite<3> {
        let TargetRay { near, far, .. } = self.ray;
        let empty = Compositor::<3>::START.finish(background, far);
        let is_dense = |value: &[f32; 4]| value[3] > 0.0;
        let ends = (self.values.iter().position(is_dense), self.values.iter().rposition(is_dense));
        let (Some(first_node), Some(last_node)) = ends else { return empty };
        let words = [sampling.seed as u32, (sampling.seed >> 32) as u32];
        let count = sampling.coarse_count;
        let block = CoarseBlock { seed: words, sample_count: count, jitter: sampling.jitter };
        // Only the samples up to a node before and behind those with a density.
        let node_count = self.values.len() as u32;
        let first = (first_node as u32).saturating_sub(1) * count / node_count;
        let last = ((last_node as u32 + 2) * count).div_ceil(node_count).min(count - 1);
        let mut depths: Vec<f32> =
            (first..=last).map(|sample| coarse_depth(&self.ray, pixel, sample, &block)).collect();
        let behind = if last + 1 < count { coarse_depth(&self.ray, pixel, last + 1, &block) } else { far };
        let mut weights = vec![0.0; depths.len()];
        let seen = self.sum(&depths, behind, background, |sample, weight| weights[sample] = weight);
        let added_count = sampling.importance_count + sampling.depth_count;
        if added_count == 0 || seen.opacity < MIN_OPACITY {
            return seen;
        }
        let block = FineBlock {
            seed: words,
            coarse_count: count,
            importance_count: sampling.importance_count,
            depth_count: sampling.depth_count,
            depth_deviation: sampling.depth_deviation,
            depth_times_opacity: u32::from(sampling.published_depth),
        };
        // The draws of importance samples increase: one walk through the parts finds all of theirs.
        let mass = |part: u32| {
            let weight = part.checked_sub(first).and_then(|index| weights.get(index as usize));
            weight.copied().unwrap_or(0.0) + PROBABILITY_FLOOR
        };
        let total: f32 = weights.iter().sum::<f32>() + count as f32 * PROBABILITY_FLOOR;
        let (mut part, mut below) = (0, 0.0);
        let mut added = Vec::with_capacity(added_count as usize);
        for index in 0..sampling.importance_count {
            let [draw, inside] = random_draw(pixel, index, &block);
            while part + 1 < count && below + mass(part) <= draw * total {
                below += mass(part);
                part += 1;
            }
            added.push(stratified_depth(near, far, part, count, inside));
        }
        let centre = if sampling.published_depth { seen.depth * seen.opacity } else { seen.depth };
        for index in sampling.importance_count..added_count {
            let [deviation, _] = random_draw(pixel, index, &block);
            added.push(clamp(centre + deviation * sampling.depth_deviation, near, far));
        }
        // Outside there is nothing to see.
        let front = depths[0];
        depths.extend(added.into_iter().filter(|depth| (front..behind).contains(depth)));
        depths.sort_unstable_by(f32::total_cmp);
        self.sum(&depths, behind, background, |_, _| {})
    }

    /// Composites samples, and tells each one's weight.
    fn sum(
        &self,
        depths: &[f32],
        behind: f32,
        background: &[f32; 3],
        mut tell: impl FnMut(usize, f32),
    ) -> Composite<3> {
        let mut compositor = Compositor::<3>::START;
        for (sample, depth) in depths.iter().enumerate() {
            let length = depths.get(sample + 1).copied().unwrap_or(behind) - depth;
            let [red, green, blue, density] = self.value(*depth);
            tell(sample, compositor.add(&[red, green, blue], density * length, *depth));
            if compositor.is_terminated(MIN_TRANSMITTANCE) {
                break;
            }
        }
        compositor.finish(background, self.ray.far)
    }
}

/// Weights of four nodes at equal distances for a place between the middle two, by the cubic polynomial through them.
fn cubic_weights(share: f32) -> [f32; 4] {
    let (before, along, left, behind) = (share + 1.0, share, 1.0 - share, 2.0 - share);
    [
        -along * left * behind / 6.0,
        before * left * behind / 2.0,
        before * along * behind / 2.0,
        -before * along * left / 6.0,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    const RAY: TargetRay = TargetRay { origin: [0.0; 3], near: 1.0, direction: [0.0, 0.0, 1.0], far: 2.0 };
    const WHITE: [f32; 3] = [1.0; 3];

    /// 16 nodes whose density follows the depth behind the near bound.
    fn nodes(density: impl Fn(f32) -> f32) -> Vec<[f32; 4]> {
        (0..16).map(|node| [0.25, 0.5, 0.75, density(NodeRay::depth(&RAY, node, 16) - 1.0)]).collect()
    }

    #[test]
    fn cubic_densities_are_exact_and_never_negative() {
        let cubic = |depth: f32| 2.0 - 3.0 * depth + 8.0 * depth.powi(2) - 5.0 * depth.powi(3);
        let values = nodes(cubic);
        let ray = NodeRay { ray: RAY, values: &values };
        for depth in [1.1, 1.25, 1.333, 1.6, 1.9] {
            let [red, _, blue, density] = ray.value(depth);
            assert!((density - cubic(depth - 1.0)).abs() < 1.0e-5, "{density} at {depth}");
            assert!((red - 0.25).abs() < 1.0e-6 && (blue - 0.75).abs() < 1.0e-6);
        }
        assert_eq!(NodeRay { ray: RAY, values: &nodes(|_| -3.0) }.value(1.5)[3], 0.0);
    }

    #[test]
    fn a_uniform_mist_has_its_closed_form() {
        let density = 1.5;
        for sampling in [Sampling::default(), Sampling { importance_count: 0, depth_count: 0, ..Sampling::default() }] {
            let found = NodeRay { ray: RAY, values: &nodes(|_| density) }.composite(7, &sampling, &WHITE);
            // The first sample stands behind the near bound, by a 64th of the ray at most.
            let opacity = 1.0 - (-density).exp();
            assert!((found.opacity - opacity).abs() < density / 64.0, "{} {opacity}", found.opacity);
            let expected = 0.25 * found.opacity + 1.0 - found.opacity;
            assert!((found.channels[0] - expected).abs() < 1.0e-5, "{:?}", found.channels);
            assert!(found.depth > 1.3 && found.depth < 1.5, "{}", found.depth);
        }
    }

    #[test]
    fn a_wall_and_nothing() {
        let wall = nodes(|depth| if depth < 0.4 { -50.0 } else { 400.0 });
        let found = NodeRay { ray: RAY, values: &wall }.composite(0, &Sampling::default(), &WHITE);
        assert!(found.opacity > 0.999 && found.depth > 1.33 && found.depth < 1.47, "{found:?}");
        let nothing = NodeRay { ray: RAY, values: &nodes(|_| -1.0) }.composite(0, &Sampling::default(), &WHITE);
        assert_eq!((nothing.channels, nothing.opacity, nothing.depth), (WHITE, 0.0, 2.0));
    }
}
