//! What better depths, visibility or blending could gain on the training-free field: each is replaced by the truth's choice.
//!
//! `cargo run --release -p viewfuse-research -- headroom SIDE MAX_TARGETS GROUP=SCENE=PROTOCOL...`
//!
//! A scene is a folder, or `made:PLACE/RIG/SEED` or `made:KIND/INDEX`, which is generated with exact depths. Rows are means over
//! the pictures of a group. Pictures have a longest side of `SIDE`; at most `MAX_TARGETS` of a job are taken. Below the table stands
//! what was run. Columns, all but the first two gains in decibels over the sweep:
//!
//! ```text
//! field            the training-free field as it is: of objects with silhouettes the visual hull
//! sweep            the plane sweep, with the silhouettes where there are some
//! temperature      the best temperature of the softmax over planes
//! visibility       on each plane the best subset of the five sources of greatest weight
//! one source       the best single source under the posterior over planes
//! blend            the best convex combination of the sources under it
//! plane            the plane whose blended colour is nearest to the truth
//! plane and blend  on that plane the best convex combination
//! depth            exact depth of the generator, with the field's visibility
//! ... and visibility, ... and blend   likewise, with exact visibility, with the best convex combination
//! opacity          the photograph's own alpha
//! unseen           pixels that no source sees by the field's visibility, by exact depths, and the former's squared error
//! ```
//!
//! All choices by colour are made on windows of 3x3 pixels and see the truth: they bound what could be gained, from above.

mod made;
mod oracle;
mod table;

use super::planes::TargetPlanes;
use super::planes::samples::Colour;
use super::planes::visit::{SCHEME, visit};
use anyhow::{Context, bail, ensure};
use made::Made;
use oracle::oracles;
use std::path::{Path, PathBuf};
use table::{Row, Target, table};
use viewfuse_evaluate::protocol::Protocol;
use viewfuse_kernels::plane_sweep::blend::blend;
use viewfuse_scene::Scene;
use viewfuse_scene::photographs::Album;

/// Largest difference between the picture that is put together here and the field's own, of 1.
const MAX_DIFFERENCE: f32 = 2.0e-3;

pub(crate) fn run(arguments: &[String]) -> anyhow::Result<()> {
    let [side, most_targets, jobs @ ..] = arguments else {
        bail!("usage: headroom SIDE MAX_TARGETS GROUP=SCENE=PROTOCOL...");
    };
    let (side, most_targets): (u32, usize) = (side.parse()?, most_targets.parse()?);
    let scratch = std::env::temp_dir().join(format!("viewfuse-headroom-{}", std::process::id()));
    let mut rows = Vec::new();
    for (index, job) in jobs.iter().enumerate() {
        let [group, scene, protocol] = job.splitn(3, '=').collect::<Vec<_>>()[..] else {
            bail!("'{job}': a job is GROUP=SCENE=PROTOCOL");
        };
        let made = scene.strip_prefix("made:").map(|words| Made::parse(words, side)).transpose()?;
        let folder = match &made {
            None => PathBuf::from(scene),
            Some(made) => {
                let folder = scratch.join(index.to_string());
                made.write(&folder)?;
                folder
            }
        };
        let before = rows.len();
        let measured = measure(&folder, made.as_ref(), &protocol.parse()?, side, most_targets, group, &mut rows);
        measured.with_context(|| job.clone())?;
        eprint!("{}", table(&rows[before..]));
    }
    if scratch.exists() {
        std::fs::remove_dir_all(&scratch)?;
    }
    let run: Vec<String> = jobs.iter().map(|job| shown(job)).collect();
    let head = format!("Pictures of {side} pixels, weights {SCHEME}, at most {most_targets} targets a job:\n");
    println!("{}\n{head}{}", table(&rows), run.join("\n"));
    Ok(())
}

/// A job without the folders that its scene lies in.
fn shown(job: &str) -> String {
    let words: Vec<&str> = job.splitn(3, '=').collect();
    let [group, scene, protocol] = words[..] else { return job.to_owned() };
    let name = Path::new(scene).file_name().unwrap_or_default().to_string_lossy().into_owned();
    format!("{group}: {}, {protocol}", if scene.starts_with("made:") { scene } else { &name })
}

fn measure(
    folder: &Path,
    made: Option<&Made>,
    protocol: &Protocol,
    side: u32,
    most_targets: usize,
    group: &str,
    rows: &mut Vec<Row>,
) -> anyhow::Result<()> {
    visit(Scene::open(folder)?, protocol, side, most_targets, |visit| {
        let blended: Vec<usize> = visit.blended.iter().map(|source| visit.sources[*source]).collect();
        let depths = made.map(|made| made.depths(&blended, visit.target, visit.scene.frame.scale)).transpose()?;
        let colours = visit.photograph();
        let oracles = oracles(visit.planes, &colours, depths.as_ref());
        let opacity = check(visit.planes, &oracles.base)?;
        let alpha = match visit.has_silhouettes {
            true => alpha(visit.album, visit.target, visit.size)?,
            false => None,
        };
        let target = Target {
            truth: &colours,
            seen: &visit.seen(),
            opacity: &opacity,
            alpha: alpha.as_deref(),
            background: visit.background,
        };
        rows.push(target.row(group, visit.truth.psnr, &oracles));
        Ok(())
    })
}

/// The field's opacity; fails if the picture that is put together here is not the field's own.
fn check(planes: &TargetPlanes, base: &[Colour]) -> anyhow::Result<Vec<f32>> {
    let width = planes.block.target.width as usize;
    let mut opacity = Vec::with_capacity(base.len());
    for (pixel, own) in base.iter().enumerate() {
        let at = [(pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5];
        let (texels, disparities) = (&planes.texels[..], &planes.disparities[..]);
        let colour = blend(&planes.block, &planes.views[..], texels, disparities, &planes.costs[..], at).colour;
        let differs = |channel: usize| !((own[channel] * colour[3] - colour[channel]).abs() <= MAX_DIFFERENCE);
        ensure!(!(0..3).any(differs), "pixel {pixel}: {own:?} is not the field's {colour:?}");
        opacity.push(colour[3]);
    }
    Ok(opacity)
}

/// The photograph's own alpha: what white and black behind it have in common. `None` if it has none.
fn alpha(album: &Album<'_>, target: usize, size: [u32; 2]) -> anyhow::Result<Option<Vec<f32>>> {
    let [white, black] = [1.0, 0.0].map(|level| album.truth(target, size, Some([level; 3])));
    let (white, black) = (white?.picture, black?.picture);
    let alpha = |(white, black): (&image::Rgb<u8>, &image::Rgb<u8>)| {
        1.0 - (f32::from(white.0[1]) - f32::from(black.0[1])) / 255.0
    };
    let alphas: Vec<f32> = white.pixels().zip(black.pixels()).map(alpha).collect();
    Ok(Some(alphas).filter(|alphas| alphas.iter().any(|alpha| *alpha < 0.5)))
}
