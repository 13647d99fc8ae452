//! What refining poses by the photographs themselves gains.
//!
//! `cargo run --release -p viewfuse-research -- refined_poses SOLVER SCENE...`
//!
//! As `poses`, on other sets. Errors are of the accepted photographs, by the solver and after the refinement; where that is not
//! kept, as by the solver.
//!
//! ```text
//! rotation        median over pairs of the angle between relative rotations found and known, degrees
//! centres         root mean square distance of the camera centres, aligned, in percent of their spread
//! left-out score  of the verdict, mean over the photographs, decibels
//! ```

use super::sets::{REFINED_SETS, neighbours};
use super::truth::errors;
use super::{found_or_few, solver_of, view_of};
use anyhow::{Context, bail};
use viewfuse_scene::Scene;

pub(crate) fn run(arguments: &[String]) -> anyhow::Result<()> {
    let [solver, scenes @ ..] = arguments else { bail!("usage: refined_poses SOLVER SCENE...") };
    let solver = solver_of(solver);
    println!("                                                  rotation        centres         left-out score");
    println!("scene         photographs  seed focal   accepted  solver refined  solver refined  solver refined");
    let (mut accepted, mut kept, mut rotations, mut centres) = (0, 0, 0, 0);
    for folder in scenes {
        let scene = Scene::open(folder)?;
        for set in REFINED_SETS.iter().filter(|set| set.count <= scene.views.len()) {
            let views = neighbours(&scene, set);
            let head = format!("{:<15} {:>9} {:>5} {:<7}", scene.name(), views.len(), set.seed, set.focal.name());
            let found = found_or_few(&scene, set, &views, solver.as_ref(), true)
                .with_context(|| format!("{folder}: {set:?}"))?;
            let Some((found, verdict)) = found.as_ref().and_then(|(own, _)| Some((own, own.verdict.as_ref().ok()?)))
            else {
                println!("{head}  refused");
                continue;
            };
            let by_solver = found.attempts[verdict.attempt].solution.as_ref().context("a solution")?;
            let [before, after] = [by_solver, &verdict.solution]
                .map(|solution| errors(&scene, solution, &verdict.photos, |photo| view_of(found, &views, photo)));
            let mean = verdict.verified.iter().map(|own| own.left_out.score).sum::<f64>();
            let mean = mean / verdict.verified.len() as f64;
            let [score, refined] = verdict.refinement.map_or([mean; 2], |own| [own.before, own.after]);
            println!(
                "{head} {:>9} {:>7.2} {:>7.2} {:>7.1} {:>7.1} {score:>7.2} {refined:>7.2}",
                after.count, before.rotation, after.rotation, before.centres, after.centres
            );
            accepted += 1;
            kept += usize::from(verdict.refinement.is_some());
            rotations += usize::from(after.rotation < before.rotation);
            centres += usize::from(after.centres < before.centres);
        }
    }
    println!(
        "\n{accepted} accepted sets: {kept} refinements kept; rotations nearer in {rotations}, centres nearer in {centres}"
    );
    Ok(())
}
