//! What views show on planes.

use super::{BEHIND, disparity, look_up, project_plane};
use crate::bounded::Bounded;
use crate::camera_oracle::cell;
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
type ViewColour = Option<[Bounded; 3]>;

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
        let parts: Vec<ViewEvidence> =
            views.iter().map(|view| view_evidence(frustum, view, texels, disparities, pixel, number)).collect();
        for (grey, part) in found.grey.iter_mut().zip(&parts) {
            grey[plane] = part.colour.map(|colour| colour.map_or(UNSEEN.into(), mean));
        }
        let [difference, weight] = compared(pairs, &parts);
        let hull = parts.iter().try_fold(Bounded::ONE, |hull, part| Some(hull * part.inside?));
        let nowhere = parts.iter().any(|part| part.inside == Some(Bounded::ZERO));
        found.evidence[0][plane] = difference;
        found.evidence[1][plane] = weight;
        found.evidence[2][plane] = dissent(views, &parts);
        found.evidence[3][plane] = if nowhere { Some(Bounded::ZERO) } else { hull };
    }
    found
}

/// One view's part.
struct ViewEvidence {
    /// `None`: undecided.
    colour: Option<ViewColour>,
    /// How far its silhouette contains the point.
    inside: Option<Bounded>,
    /// How far the point contradicts its disparities, times the confidence; the inner `None` if it has none there.
    doubt: Option<Option<Bounded>>,
}

fn view_evidence(
    frustum: &FrustumBlock,
    view: &SweptView,
    texels: &[[f32; 4]],
    disparities: &[[f32; 2]],
    pixel: u32,
    plane: usize,
) -> ViewEvidence {
    let camera = &view.camera;
    let width = frustum.camera.width;
    let at = [(pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5];
    let disparity = disparity(frustum.far_disparity, frustum.disparity_step, plane);
    let seen = project_plane(&frustum.camera, camera, at, disparity);
    let has_silhouettes = frustum.has_silhouettes != 0;
    match seen.in_image {
        None => return ViewEvidence { colour: None, inside: (!has_silhouettes).then_some(Bounded::ONE), doubt: None },
        Some(false) => {
            let inside = if has_silhouettes { Bounded::ZERO } else { Bounded::ONE };
            return ViewEvidence { colour: Some(None), inside: Some(inside), doubt: Some(None) };
        }
        Some(true) => {}
    }
    let texel = look_up(camera, texels, seen.x, seen.y);
    let colour = texel[3].below(MIN_ALPHA.into()).map(|transparent| {
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
    ViewEvidence { colour, inside: Some(inside), doubt }
}

fn mean([red, green, blue]: [Bounded; 3]) -> Bounded {
    (red + green + blue) / Bounded::from(3.0)
}

/// Differences of the pairs that see the point, weighted and summed, and their weights.
fn compared(pairs: &[ViewPair], parts: &[ViewEvidence]) -> [Option<Bounded>; 2] {
    let (mut difference, mut weight) = (Bounded::ZERO, Bounded::ZERO);
    for pair in pairs.iter().filter(|pair| pair.weight > 0.0) {
        match (parts[pair.first as usize].colour, parts[pair.second as usize].colour) {
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
fn dissent(views: &[SweptView], parts: &[ViewEvidence]) -> Option<Bounded> {
    let (mut sum, mut informed) = (Bounded::ZERO, Bounded::ZERO);
    for (view, part) in views.iter().zip(parts) {
        if view.disparity_step > 0.0
            && let Some(doubt) = part.doubt?
        {
            sum = sum + Bounded::from(view.weight) * doubt;
            informed = informed + Bounded::from(view.weight);
        }
    }
    Some(sum / informed.greater(1.0e-6.into()))
}
