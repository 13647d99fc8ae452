//! Common parts of learned fields: the form of their input images, near and far bounds, and the unit of length.

use super::options::list;
use viewfuse_core::Vec3;
use viewfuse_core::camera::Camera;
use viewfuse_job::progress::Progress;
use viewfuse_scene::photographs::SourceImages;
use viewfuse_scene::rig::Rig;
use viewfuse_scene::unit::{RigUnit, SRN_DISTANCE};

/// Help of the flag of near and far bounds.
pub(super) const NEAR_FAR: &str = "Near and far bounds of rays, world units [default: 8/13 and 18/13 of the cameras' \
    distance from the point that they look at]";

/// The value of that flag.
pub(super) fn parse_near_far(text: &str) -> Result<[f32; 2], String> {
    let bounds: Option<[f32; 2]> = list(text).and_then(|bounds| bounds.try_into().ok());
    let fits = |[near, far]: &[f32; 2]| *near >= 0.0 && near < far && far.is_finite();
    bounds
        .filter(fits)
        .ok_or_else(|| "two distances, for example 0.8,1.8, the first at least 0 and less than the second".to_owned())
}

/// Near and far bounds as published for SRN's cars (0.8 and 1.8 for cameras at distance 1.3), as multiples of the
/// cameras' distance from the point that they look at.
const NEAR_FAR_SHARES: [f32; 2] = [8.0 / 13.0, 18.0 / 13.0];

/// Default near and far bounds, from the mean distance of the cameras to the point that they look at. A single camera
/// does not define that point: then it is the world's origin, where SRN's objects are.
pub fn default_near_far(cameras: &[Camera]) -> [f32; 2] {
    usual_near_far(distance_of(cameras))
}

fn distance_of(cameras: &[Camera]) -> f32 {
    match cameras {
        [camera] => camera.pose.centre_world().length(),
        cameras => Rig::of(cameras).distance,
    }
}

/// Default bounds for cameras at this distance from what they look at.
pub(super) fn usual_near_far(distance: f32) -> [f32; 2] {
    NEAR_FAR_SHARES.map(|share| share * if distance > 0.0 { distance } else { 1.0 })
}

/// How far sources are from what they look at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Distance {
    /// The mean, in world units.
    pub(super) length: f32,
    /// Whether nothing says so: neither the sources nor all photographs of the scene look at one point.
    pub(super) is_guess: bool,
}

impl Distance {
    /// That from the point where the sources' principal axes meet, or from the world's origin for a single one. Where
    /// the photographs of the scene look at another point, or the sources alone at none, it is that from the former:
    /// two neighbouring sources say little of how far away what they look at is. Where the photographs look at none, it
    /// is the middle of the depths that the scene's files state, or that from the origin if it is in the sources' pictures.
    pub(super) fn of(sources: &SourceImages) -> Distance {
        let cameras = cameras_of(sources);
        let from = |point: Vec3| {
            let sum: f32 = cameras.iter().map(|camera| camera.pose.centre_world().distance(point)).sum();
            sum / cameras.len().max(1) as f32
        };
        let alone = distance_of(&cameras);
        let do_meet = cameras.len() < 2 || Rig::meeting_point(&cameras).is_some();
        let stated = sources.near_far.map(|[near, far]| 0.5 * (near + far)).filter(|middle| middle.is_normal());
        let sees_origin = || cameras.iter().all(|camera| camera.block(0).project(Vec3::ZERO).in_image);
        match sources.focus.map(from) {
            Some(all) if !do_meet || (alone / all - 1.0).abs() > SAME_DISTANCE => {
                Distance { length: all, is_guess: false }
            }
            Some(_) => Distance { length: alone, is_guess: false },
            None if do_meet && cameras.len() > 1 => Distance { length: alone, is_guess: false },
            None if stated.is_some() => Distance { length: stated.unwrap_or(alone), is_guess: false },
            None if do_meet => Distance { length: alone, is_guess: !sees_origin() },
            None if sees_origin() => Distance { length: from(Vec3::ZERO), is_guess: true },
            None => Distance { length: alone, is_guess: true },
        }
    }

    /// The unit in which a network measures lengths: the world's own for a single camera whose scene has no others.
    pub(super) fn unit(self, sources: &SourceImages) -> RigUnit {
        let cameras = cameras_of(sources);
        match sources.focus.is_none() && RigUnit::of(&cameras).is_world() {
            true => RigUnit::WORLD,
            false => RigUnit::of_distance(self.length).unless_trained(),
        }
    }

    /// Says that near and far bounds, which nobody gave, rest on a guess.
    pub(super) fn warn_of_guess(self, progress: &dyn Progress) {
        let [near, far] = usual_near_far(self.length);
        if self.is_guess {
            progress.warn(&format!(
                "the photographs look at no common point, so that nothing says how far away is what they show: the near \
                 and far bounds of rays, {near:.3} and {far:.3}, are guesses; give the bounds"
            ));
        }
    }
}

fn cameras_of(sources: &SourceImages) -> Vec<Camera> {
    sources.images.iter().map(|image| image.camera).collect()
}

/// Relative difference from [`SRN_DISTANCE`] up to which cameras count as being at it.
const SAME_DISTANCE: f32 = 0.1;

/// Share of the cameras' distance by which what they look at may be beside the world's origin.
const MAX_OFFSET: f32 = 0.05;

/// Says that a network takes points as they lie in the world, where what the cameras look at is not at its origin, as
/// objects are that networks learn from.
pub(super) fn warn_of_place(distance: Distance, sources: &SourceImages, progress: &dyn Progress) {
    let focus = sources.focus.or_else(|| Rig::meeting_point(&cameras_of(sources)));
    let offset = focus.map_or(0.0, |focus| focus.length() / distance.length);
    if offset > MAX_OFFSET {
        progress.warn(&format!(
            "what the cameras look at is {:.0} % of their distance away from the world's origin, and the network takes \
             points from there: one that learned from objects at the origin draws something else; move the scene to \
             where it was when the network learned",
            100.0 * offset
        ));
    }
}

/// Says that a network measures in another unit than the world's, if it does; or that it measures in the world's, where
/// its cameras may have been nearer or farther while it learned.
pub(super) fn warn_of_unit(unit: RigUnit, distance: Distance, progress: &dyn Progress) {
    let Distance { length: distance, is_guess } = distance;
    if unit.is_world() && !is_guess && (distance / SRN_DISTANCE - 1.0).abs() > SAME_DISTANCE {
        progress.warn(&format!(
            "the cameras are {distance:.2} units from what they look at, and the network takes lengths as they are: a \
             network that learned from cameras at another distance ({SRN_DISTANCE} in SRN's cars) draws something \
             else; scale the scene to what it learned from"
        ));
    }
    if !unit.is_world() {
        progress.warn(&format!(
            "the cameras are {:.3e} units from what they look at: for the network all lengths are divided by {:.3e}, \
             so that this distance is {SRN_DISTANCE}, as in the scenes that published networks learned from",
            unit.length() * SRN_DISTANCE,
            unit.length()
        ));
    }
}

/// The far bound of rays is not above the near bound, or a bound is NaN or infinite.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the near bound of rays, {near}, must be below the far bound, {far}, and both must be finite")]
pub struct NoDepths {
    /// The near bound.
    pub near: f32,
    /// The far bound.
    pub far: f32,
}

impl NoDepths {
    /// Returns the bounds unchanged, if the far bound is above the near bound and both are finite.
    ///
    /// # Errors
    /// [`NoDepths`].
    pub fn check([near, far]: [f32; 2]) -> Result<[f32; 2], NoDepths> {
        // Not the other way round: NaN must fail, too.
        if near < far && (far - near).is_finite() { Ok([near, far]) } else { Err(NoDepths { near, far }) }
    }
}

/// A texel (colour times opacity, opacity) over white: red, green, blue in `[-1, 1]`.
pub(super) fn over_white([red, green, blue, alpha]: [f32; 4]) -> [f32; 3] {
    [red, green, blue].map(|colour| 2.0 * (colour + 1.0 - alpha) - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use viewfuse_core::camera::Pinhole;
    use viewfuse_core::pose::Pose;
    use viewfuse_scene::photographs::SourceImage;

    /// Cameras at these places that look at others, of a scene whose photographs look at `focus`.
    fn sources(places: &[[Vec3; 2]], focus: Option<Vec3>) -> SourceImages {
        let pinhole = Pinhole::new([16.0; 2], [8.0; 2], 16, 16).expect("a pinhole");
        let camera =
            |[from, to]: &[Vec3; 2]| Camera { pose: Pose::look_at(*from, *to, Vec3::Y).expect("a pose"), pinhole };
        let image = |place| SourceImage { camera: camera(place), texels: vec![[0.5, 0.5, 0.5, 1.0]; 256] };
        SourceImages {
            images: places.iter().map(image).collect(),
            background: [1.0; 3],
            has_silhouettes: true,
            points: Vec::new(),
            near_far: None,
            focus,
            warnings: Vec::new(),
        }
    }

    /// One at a distance of 1.3 from the origin, another beside it, which look at points so far ahead.
    fn pair(depth: f32, focus: Option<Vec3>) -> SourceImages {
        let at = |x: f32| Vec3::new(x, 0.0, 1.3);
        sources(&[[at(-0.1), Vec3::new(0.0, 0.0, 1.3 - depth)], [at(0.1), Vec3::new(0.0, 0.0, 1.3 - depth)]], focus)
    }

    #[test]
    fn the_distance_is_that_from_where_axes_meet() {
        let distance = |sources: &SourceImages| Distance::of(sources);
        let is_near = |found: Distance, length: f32, is_guess: bool| {
            assert!((found.length - length).abs() < 0.02 * length && found.is_guess == is_guess, "{found:?}");
        };
        is_near(distance(&pair(1.3, None)), 1.3, false);
        // Its photographs look at a nearer point than these two do.
        is_near(distance(&pair(3.0, Some(Vec3::ZERO))), 1.3, false);
        is_near(distance(&pair(3.0, None)), 3.0, false);
        // Axes that are parallel, and that part.
        let parallel = [-0.1, 0.1].map(|x| [Vec3::new(x, 0.0, 1.3), Vec3::new(x, 0.0, 0.0)]);
        let parting = [-0.1, 0.1].map(|x| [Vec3::new(x, 0.0, 1.3), Vec3::new(3.0 * x, 0.0, 0.0)]);
        for places in [parallel, parting] {
            is_near(distance(&sources(&places, Some(Vec3::ZERO))), 1.3, false);
            is_near(distance(&sources(&places, None)), 1.3, true);
        }
        // The origin is behind them.
        let moved = parallel.map(|place| place.map(|point| point - Vec3::new(0.0, 0.0, 9.0)));
        assert!(distance(&sources(&moved, None)).is_guess);
        // A single one looks at the origin, or at what the others look at.
        is_near(distance(&sources(&parallel[..1], None)), 1.3, false);
        is_near(distance(&sources(&moved[..1], Some(Vec3::new(0.0, 0.0, -9.0)))), 1.3, false);
        assert!(distance(&sources(&moved[..1], None)).is_guess);
    }

    #[test]
    fn a_unit_is_that_of_the_distance() {
        let unit = |sources: &SourceImages| Distance::of(sources).unit(sources);
        assert!(unit(&pair(1.3, None)).is_world() && unit(&pair(4.0, None)).is_world());
        let far = pair(13.0, Some(Vec3::new(0.0, 0.0, -11.7)));
        assert!((unit(&far).length() - 10.0).abs() < 0.01);
        let single = sources(&[[Vec3::new(0.0, 0.0, 13.0), Vec3::ZERO]], None);
        assert!(unit(&single).is_world(), "nothing says what it is far from");
        assert!((unit(&SourceImages { focus: Some(Vec3::ZERO), ..single }).length() - 10.0).abs() < 0.01);
    }
}
