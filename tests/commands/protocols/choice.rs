//! Which views a protocol takes.

use std::collections::HashSet;
use std::path::Path;
use viewfuse::evaluate::protocol::{Draws, Job, Plan, Protocol, ProtocolError};
use viewfuse::scene::Scene;
use viewfuse::scene::rig::Rig;
use viewfuse_tests::command::toy;

viewfuse_tests::trials![
    protocols_as_text,
    random_hangs_on_seed_name_and_trial_alone,
    random_prefers_no_view,
    more_sources_hold_the_fewer,
    close_has_exactly_one_near_source,
    fixed_takes_the_views_of_its_lists,
    a_field_may_need_more_sources,
    a_target_is_no_source_under_another_name,
];

const DRAWS: Draws = Draws { seed: 7, trial_count: 5, target_count: 4 };

fn protocol(text: &str) -> Protocol {
    text.parse().unwrap_or_else(|error| panic!("{text}: {error}"))
}

fn scene(path: &Path) -> Scene {
    Scene::open(path).expect("a scene")
}

fn plan(text: &str, scenes: &[Scene], draws: Draws) -> Plan {
    protocol(text).plan(scenes, draws, 2).unwrap_or_else(|error| panic!("{text}: {error}"))
}

/// Every view at most once, no target a source, sources ascending.
#[track_caller]
fn assert_sound(job: &Job) {
    let views: HashSet<usize> = job.sources.iter().chain(&job.targets).copied().collect();
    assert_eq!(views.len(), job.sources.len() + job.targets.len(), "{job:?}");
    assert!(job.sources.is_sorted(), "{job:?}");
}

fn protocols_as_text() {
    for (text, whole) in [
        ("random", "random:sources=3"),
        ("random:sources=5", "random:sources=5"),
        ("close", "close:sources=5,degrees=10"),
        ("close:degrees=7.5", "close:sources=5,degrees=7.5"),
        ("count", "count:sources=2+8+16+32"),
        ("count:sources=9+3+9", "count:sources=3+9"),
        ("fixed", "fixed:cars"),
        ("fixed:5,8,14:3,10,18", "fixed:chairs"),
        ("fixed:pixelnerf-2", "fixed:pixelnerf-2"),
        ("fixed:0..3:all/2", "fixed:0..3:all/2"),
        ("nearest:4", "nearest:4"),
        ("nearest:4:2,5", "nearest:4:2,5"),
        ("llff:3", "llff:3"),
        ("dtu:9", "dtu:9"),
        ("dtu:3,masks=given", "dtu:3,masks=given"),
        ("blender:8", "blender:8"),
    ] {
        assert_eq!(protocol(text).to_string(), whole);
        assert_eq!(protocol(whole), protocol(text));
    }
    for (text, part) in [
        ("farthest", "unknown protocol 'farthest'; there are: random[:sources=N]"),
        ("nearest", "protocol 'nearest': sources must be a whole number from 1 to 256, not ''"),
        ("nearest:3:", "unknown protocol"),
        ("llff:0", "protocol 'llff': sources must be a whole number from 1 to 256, not '0'"),
        ("llff:3,masks=given", "unknown protocol"),
        ("dtu:10", "protocol 'dtu': sources must be a whole number from 1 to 9, not '10'"),
        ("dtu:3,masks=no", "unknown protocol"),
        ("blender:4", "protocol 'blender': sources must be 8, not '4'"),
        ("random:degrees=3", "unknown protocol"),
        ("random:sources", "unknown protocol"),
        ("fixed:boats", "unknown protocol 'fixed:boats'"),
        ("fixed:1:", "unknown protocol"),
        ("random:sources=0", "sources must be a whole number from 1 to 256, not '0'"),
        ("count:sources=2+x", "not 'x'"),
        ("close:degrees=0", "degrees must be above 0 and at most 180"),
    ] {
        let error = text.parse::<Protocol>().expect_err(text).to_string();
        assert!(error.contains(part), "{text}: {error}");
    }
}

fn random_hangs_on_seed_name_and_trial_alone() {
    let (one, two) = (toy(), toy());
    let elsewhere = scene(&two.join("toy"));
    let here = scene(&one.join("toy"));
    std::fs::rename(one.join("toy"), one.join("lorry")).expect("another name");
    let renamed = scene(&one.join("lorry"));
    let jobs = |scenes: &[Scene], draws| plan("random", scenes, draws).jobs;

    let alone = jobs(std::slice::from_ref(&elsewhere), DRAWS);
    assert_eq!(alone.len(), 5);
    for (trial, job) in alone.iter().enumerate() {
        assert_sound(job);
        assert_eq!((job.trial as usize, job.sources.len(), job.targets.len()), (trial, 3, 4));
    }
    let different: HashSet<_> = alone.iter().map(|job| (&job.sources, &job.targets)).collect();
    assert_eq!(different.len(), 5);

    // The order of the scenes, and where they lie, change nothing.
    let mixed = jobs(&[renamed.clone(), elsewhere.clone()], DRAWS);
    let of_second: Vec<Job> = mixed[5..].iter().map(|job| Job { scene: 0, ..job.clone() }).collect();
    assert_eq!(of_second, alone);
    assert_eq!(here.views.len(), renamed.views.len());
    assert_ne!(mixed[0].targets, alone[0].targets);
    // More trials only add some.
    assert_eq!(jobs(std::slice::from_ref(&elsewhere), Draws { trial_count: 9, ..DRAWS })[..5], alone);
    let other_seed = jobs(std::slice::from_ref(&elsewhere), Draws { seed: 8, ..DRAWS });
    assert!(alone.iter().zip(&other_seed).all(|(a, b)| a.targets != b.targets));
}

/// Over many trials every view is a source about as often as any other.
fn random_prefers_no_view() {
    let folder = toy();
    let scenes = [scene(&folder.join("toy"))];
    let jobs = plan("random", &scenes, Draws { trial_count: 4000, ..DRAWS }).jobs;
    let mut counts = [0_u32; 24];
    jobs.iter().flat_map(|job| &job.sources).for_each(|&view| counts[view] += 1);
    // 500 expected of 4000 trials of probability 1/8: a standard deviation of 21.
    assert!(counts.iter().all(|count| (400..600).contains(count)), "{counts:?}");
}

fn more_sources_hold_the_fewer() {
    let folder = toy();
    let scenes = [scene(&folder.join("toy"))];
    let Plan { jobs, notes } = plan("count", &scenes, DRAWS);
    // 24 photographs: 32 sources there are none.
    assert_eq!(jobs.len(), 3 * 5);
    assert_eq!(notes.len(), 1, "{notes:?}");
    assert!(notes[0].contains("toy: 24 photographs, 36 are needed for 32 sources"), "{notes:?}");
    let random = plan("random:sources=8", &scenes, DRAWS).jobs;
    for (trial, counts) in jobs.chunks(3).enumerate() {
        assert_eq!(counts.iter().map(|job| job.sources.len()).collect::<Vec<_>>(), [2, 8, 16]);
        for (fewer, more) in counts.iter().zip(&counts[1..]) {
            assert_sound(more);
            assert_eq!(fewer.targets, more.targets);
            assert!(fewer.sources.iter().all(|view| more.sources.contains(view)), "{counts:?}");
        }
        assert_eq!(counts[1], random[trial]);
    }
}

fn close_has_exactly_one_near_source() {
    let folder = toy();
    let scenes = [scene(&folder.join("toy"))];
    let cameras: Vec<_> = scenes[0].views.iter().map(|view| view.camera).collect();
    let focus = Rig::of(&cameras).focus.as_dvec3();
    let degrees = |a: usize, b: usize| {
        let [a, b] = [a, b].map(|view| (cameras[view].pose.centre_world().as_dvec3() - focus).normalize());
        a.dot(b).clamp(-1.0, 1.0).acos().to_degrees()
    };
    for limit in [25.0, 30.0, 45.0] {
        let Plan { jobs, notes } =
            plan(&format!("close:degrees={limit}"), &scenes, Draws { target_count: 24, ..DRAWS });
        for job in &jobs {
            assert_sound(job);
            assert_eq!((job.sources.len(), job.targets.len()), (5, 1));
            let near = job.sources.iter().filter(|&&source| degrees(source, job.targets[0]) < limit).count();
            assert_eq!(near, 1, "{job:?}");
        }
        // Every view that can be a target is one, in each trial; the others are told.
        let can = |&target: &usize| {
            let near = (0..24).filter(|&view| view != target && degrees(view, target) < limit).count();
            near >= 1 && 23 - near >= 4
        };
        let able: Vec<usize> = (0..24).filter(can).collect();
        for trial in jobs.chunk_by(|a, b| a.trial == b.trial) {
            let mut targets: Vec<usize> = trial.iter().map(|job| job.targets[0]).collect();
            targets.sort_unstable();
            assert_eq!(targets, able);
        }
        let told =
            notes.iter().any(|note| note.contains(&format!("toy: {} of 24 views are no targets", 24 - able.len())));
        assert_eq!(told, able.len() < 24, "{notes:?}");
    }
    // Sources differ from trial to trial.
    let jobs = plan("close:degrees=40", &scenes, DRAWS).jobs;
    assert!(jobs.iter().map(|job| &job.sources).collect::<HashSet<_>>().len() > 15);
    let error = protocol("close:degrees=0.001").plan(&scenes, DRAWS, 2).expect_err("nothing is near");
    assert!(matches!(error, ProtocolError::NoJobs { .. }), "{error}");
    assert!(error.to_string().contains("24 of 24 views are no targets"), "{error}");
}

fn fixed_takes_the_views_of_its_lists() {
    let folder = toy();
    let scenes = [scene(&folder.join("toy"))];
    let jobs = plan("fixed:chairs", &scenes, DRAWS).jobs;
    assert_eq!(jobs, [Job { scene: 0, trial: 0, sources: vec![5, 8, 14], targets: vec![3, 10, 18] }]);
    // Sources are no targets.
    assert_eq!(plan("fixed:0..20:all", &scenes, DRAWS).jobs[0].targets, [21, 22, 23]);
    for (text, part) in [
        ("fixed:cars", "toy: has no view '56'"),
        ("fixed:3:4", "too few source views: 1"),
        ("fixed:3,4:3,4", "no targets"),
    ] {
        let error = protocol(text).plan(&scenes, DRAWS, 2).expect_err(text).to_string();
        assert!(error.contains(part), "{text}: {error}");
    }
}

fn a_field_may_need_more_sources() {
    let folder = toy();
    let scenes = [scene(&folder.join("toy"))];
    let error = protocol("count:sources=2+8").plan(&scenes, DRAWS, 3).expect_err("2 are too few").to_string();
    assert!(error.contains("count:sources=2+8") && error.contains("at least 3"), "{error}");
}

/// Two photographs of one pose: the one as the source of the other would be its truth, and both as sources one.
fn a_target_is_no_source_under_another_name() {
    let folder = toy();
    for (view, other) in [("000020", "000024"), ("000003", "000025"), ("000021", "000026")] {
        for file in ["rgb/NAME.png", "pose/NAME.txt"] {
            let [from, to] = [view, other].map(|name| folder.join("toy").join(file.replace("NAME", name)));
            std::fs::copy(from, to).expect("a photograph again");
        }
    }
    let scenes = [scene(&folder.join("toy"))];
    let pose = |view: &usize| match view {
        24 => 20,
        25 => 3,
        26 => 21,
        view => *view,
    };
    for text in ["random:sources=8", "count:sources=4+16", "nearest:3", "close:degrees=20"] {
        let jobs = plan(text, &scenes, Draws { trial_count: 40, ..DRAWS }).jobs;
        assert!(jobs.iter().flat_map(|job| &job.targets).any(|target| *target != pose(target)), "{text}");
        for job in &jobs {
            assert_sound(job);
            let sources: HashSet<usize> = job.sources.iter().map(pose).collect();
            assert_eq!(sources.len(), job.sources.len(), "{text}: {job:?}");
            assert!(job.targets.iter().all(|target| !sources.contains(&pose(target))), "{text}: {job:?}");
        }
    }
    // A published list stays, and it is said.
    let notes = plan("llff:23", &scenes, DRAWS).notes;
    assert!(notes.iter().any(|note| note.contains("have the pose of a source (the first is 0000")), "{notes:?}");
    let notes = plan("fixed:0,1:1,2", &scenes, DRAWS).notes;
    assert_eq!(notes, ["toy: no targets, since they are sources: 000001"]);
}
