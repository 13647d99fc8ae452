//! Sources and targets that are drawn.

use super::draw::Draw;
use super::{angle, ascending, photographed};
use viewfuse_core::camera::Camera;
use viewfuse_scene::Scene;
use viewfuse_scene::rig::Rig;

/// The first views of the order are the targets, the next ones the sources: a smaller set of sources is a prefix of a
/// larger one.
pub(super) fn counted(
    scene: &Scene,
    draw: &Draw,
    counts: &[usize],
    target_count: usize,
    add: &mut impl FnMut(Vec<usize>, Vec<usize>),
) -> Vec<String> {
    let order = draw.order(photographed(scene));
    let (targets, rest) = order.split_at(target_count.min(order.len()));
    let sources = scene.same_poses().sources(rest.iter().copied(), targets);
    let mut notes = Vec::new();
    for &count in counts {
        let (has, wanted) = (targets.len() + sources.len(), target_count + count);
        if has < wanted {
            notes.push(format!("{}: {has} photographs, {wanted} are needed for {count} sources", scene.name()));
            continue;
        }
        add(ascending(&sources[..count]), targets.to_vec());
    }
    notes
}

/// Each target is a job: its sources are its own.
pub(super) fn close(
    scene: &Scene,
    draw: &Draw,
    source_count: usize,
    degrees: f32,
    target_count: usize,
    add: &mut impl FnMut(Vec<usize>, Vec<usize>),
) -> Vec<String> {
    let (views, poses): (Vec<usize>, _) = (photographed(scene).collect(), scene.same_poses());
    let cameras: Vec<Camera> = views.iter().map(|&view| scene.views[view].camera).collect();
    let focus = Rig::of(&cameras).focus;
    let from_focus = |view: usize| scene.views[view].camera.pose.centre_world() - focus;
    let is_near = |a: usize, b: usize| angle(from_focus(a), from_focus(b)).to_degrees() < f64::from(degrees);
    let neighbours = |target: usize| -> (Vec<usize>, Vec<usize>) {
        poses.sources(views.iter().copied(), &[target]).into_iter().partition(|&view| is_near(view, target))
    };
    let fits = |target: &usize| {
        let (near, far) = neighbours(*target);
        !near.is_empty() && far.len() + 1 >= source_count
    };
    let (fitting, others): (Vec<usize>, Vec<usize>) = views.iter().copied().partition(fits);
    for target in draw.order(fitting.iter().copied()).into_iter().take(target_count) {
        let (near, far) = neighbours(target);
        let order = draw.of_view(target);
        let (near, far) = (order.order(near), order.order(far));
        let sources: Vec<usize> = near.into_iter().take(1).chain(far.into_iter().take(source_count - 1)).collect();
        add(ascending(&sources), vec![target]);
    }
    let scene_name = scene.name();
    let mut notes = Vec::new();
    if !others.is_empty() {
        let (count, all, far) = (others.len(), views.len(), source_count - 1);
        notes.push(format!(
            "{scene_name}: {count} of {all} views are no targets: they lack a view within {degrees} degrees, or {far} \
                beyond"
        ));
    }
    if !fitting.is_empty() && fitting.len() < target_count {
        notes.push(format!("{scene_name}: {} targets instead of {target_count}", fitting.len()));
    }
    notes
}
