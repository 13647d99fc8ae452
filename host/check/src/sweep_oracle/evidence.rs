//! What views show on planes.

use super::{BEHIND, disparity, look_up, sight};
use crate::bounded::Bounded;
use crate::hull_oracle::bell;
use viewfuse_kernels::plane_sweep::PLANES;
use viewfuse_kernels::plane_sweep::evidence::{MAX_DIFFERENCE, MIN_ALPHA, UNSEEN, ViewPair};
use viewfuse_kernels::plane_sweep::frustum::{FrustumBlock, SweptView};

/// A number for each plane, where it is decided.
type Planes = [Option<Bounded>; PLANES];

/// What is known of a group of planes at a pixel.
#[derive(Clone, Debug)]
pub struct Found {
    /// `[view]`.
    pub grey: Vec<Planes>,
    /// Weighted differences, their weights, dissent, and how far the silhouettes contain the point.
    pub evidence: [Planes; 4],
}

/// What a view shows at a point: a colour, or nothing.
type Shown = Option<[Bounded; 3]>;

/// Looks at a group of planes of a pixel of the whole image.
pub fn evidence(
    frustum: &FrustumBlock,
    views: &[SweptView],
    pairs: &[ViewPair],
    texels: &[[f32; 4]],
    disparities: &[[f32; 2]],
    pixel: u32,
    group: u32,
) -> Found {
    let mut found = Found { grey: vec![[None; PLANES]; views.len()], evidence: [[None; PLANES]; 4] };
    for plane in 0..PLANES {
        let number = group as usize * PLANES + plane;
        let looks: Vec<Look> =
            views.iter().map(|view| look(frustum, view, texels, disparities, pixel, number)).collect();
        for (grey, look) in found.grey.iter_mut().zip(&looks) {
            grey[plane] = look.shown.map(|shown| shown.map_or(UNSEEN.into(), mean));
        }
        let [difference, weight] = compared(pairs, &looks);
        let hull = looks.iter().try_fold(Bounded::ONE, |hull, look| Some(hull * look.inside?));
        let nowhere = looks.iter().any(|look| look.inside == Some(Bounded::ZERO));
        found.evidence[0][plane] = difference;
        found.evidence[1][plane] = weight;
        found.evidence[2][plane] = dissent(views, &looks);
        found.evidence[3][plane] = if nowhere { Some(Bounded::ZERO) } else { hull };
    }
    found
}

/// One view's part.
struct Look {
    /// `None`: undecided.
    shown: Option<Shown>,
    /// How far its silhouette contains the point.
    inside: Option<Bounded>,
    /// How far the point contradicts its disparities, times the confidence; the inner `None` if it has none there.
    doubt: Option<Option<Bounded>>,
}

fn look(
    frustum: &FrustumBlock,
    view: &SweptView,
    texels: &[[f32; 4]],
    disparities: &[[f32; 2]],
    pixel: u32,
    plane: usize,
) -> Look {
    let camera = &view.camera;
    let width = frustum.camera.width;
    let at = [(pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5];
    let disparity = disparity(frustum.far_disparity, frustum.disparity_step, plane);
    let seen = sight(&frustum.camera, camera, at, disparity);
    let has_silhouettes = frustum.has_silhouettes != 0;
    match seen.in_image {
        None => return Look { shown: None, inside: (!has_silhouettes).then_some(Bounded::ONE), doubt: None },
        Some(false) => {
            let inside = if has_silhouettes { Bounded::ZERO } else { Bounded::ONE };
            return Look { shown: Some(None), inside: Some(inside), doubt: Some(None) };
        }
        Some(true) => {}
    }
    let texel = look_up(camera, texels, seen.x, seen.y);
    let shown = texel[3].below(MIN_ALPHA.into()).map(|transparent| {
        (!transparent).then(|| [0, 1, 2].map(|channel| texel[channel] / texel[3] * Bounded::from(view.gain[channel])))
    });
    let inside = if has_silhouettes { texel[3] } else { Bounded::ONE };
    let doubt = if view.disparity_step > 0.0 {
        cell(seen.x, camera.width).zip(cell(seen.y, camera.height)).map(|(column, row)| {
            let [surface, confidence] =
                disparities[view.first_disparity as usize + row * view.map_width as usize + column].map(Bounded::from);
            let behind = (surface - disparity / seen.depth_ratio) / Bounded::from(2.0 * view.disparity_step);
            Some(confidence * (Bounded::ONE - bell(Bounded::from(BEHIND) * behind)))
        })
    } else {
        Some(None)
    };
    Look { shown, inside: Some(inside), doubt }
}

/// The pixel of a coordinate inside the image, if it does not depend on rounding.
fn cell(coordinate: Bounded, count: u32) -> Option<usize> {
    let index = |value: f64| value.floor().clamp(0.0, f64::from(count - 1)) as usize;
    let low = index(coordinate.value - coordinate.error);
    (low == index(coordinate.value + coordinate.error)).then_some(low)
}

fn mean([red, green, blue]: [Bounded; 3]) -> Bounded {
    (red + green + blue) / Bounded::from(3.0)
}

/// Differences of the pairs that see the point, weighted and summed, and their weights.
fn compared(pairs: &[ViewPair], looks: &[Look]) -> [Option<Bounded>; 2] {
    let (mut difference, mut weight) = (Bounded::ZERO, Bounded::ZERO);
    for pair in pairs.iter().filter(|pair| pair.weight > 0.0) {
        match (looks[pair.first as usize].shown, looks[pair.second as usize].shown) {
            (Some(None), _) | (_, Some(None)) => {}
            (Some(Some(a)), Some(Some(b))) => {
                let differences = [0, 1, 2].map(|channel| (a[channel] - b[channel]).magnitude());
                let share = Bounded::from(pair.weight);
                difference = difference + share * mean(differences).lesser(MAX_DIFFERENCE.into());
                weight = weight + share;
            }
            _ => return [None; 2],
        }
    }
    [Some(difference), Some(weight)]
}

/// How far the point contradicts the views' own disparities.
fn dissent(views: &[SweptView], looks: &[Look]) -> Option<Bounded> {
    let (mut sum, mut informed) = (Bounded::ZERO, Bounded::ZERO);
    for (view, look) in views.iter().zip(looks) {
        if view.disparity_step > 0.0
            && let Some(doubt) = look.doubt?
        {
            sum = sum + Bounded::from(view.weight) * doubt;
            informed = informed + Bounded::from(view.weight);
        }
    }
    Some(sum / informed.greater(1.0e-6.into()))
}
