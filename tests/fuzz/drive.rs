//! Starts workers, starts them again where one was ended, and shows what they found.

use crate::targets::ALL;
use crate::worker::{Found, LAST, Order};
use std::env;
use std::fs;
use std::path::PathBuf;
use std::process::{Command, ExitCode};
use std::time::{Instant, SystemTime, UNIX_EPOCH};
use viewfuse_tests::patience::PATIENCE;

/// The variable that makes this program a worker.
pub(crate) const ORDER: &str = "VIEWFUSE_FUZZ_ORDER";

/// Where inputs that fell are kept: in the target folder.
fn folder() -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("fuzz");
    fs::create_dir_all(&folder).expect("a folder");
    folder
}

/// Runs a worker; one that is ended by an input runs again up to it, and keeps it.
fn run(order: &Order) -> Found {
    let start = |order: &Order| {
        let binary = env::current_exe().expect("the path of this program");
        let order = serde_json::to_string(order).expect("an order");
        Command::new(binary).env(ORDER, order).output().expect("it starts")
    };
    let output = start(order);
    let found = String::from_utf8_lossy(&output.stdout).lines().last().map(serde_json::from_str::<Found>);
    if let (true, Some(Ok(found))) = (output.status.success(), found) {
        return found;
    }
    let said = String::from_utf8_lossy(&output.stderr).trim().replace('\n', " ");
    let reason = format!("ended by {}: {said}", output.status);
    // The same inputs again, each kept before it is tried.
    let again = start(&Order { careful: true, ..order.clone() });
    let kept = order.folder.join(format!("{}-ended-{}", order.target, order.seed));
    let last = order.folder.join(LAST);
    if !again.status.success() && last.exists() {
        fs::rename(last, &kept).expect("the last input");
    }
    Found { target: order.target.clone(), executions: 1, fell: vec![(kept, reason)], ..Found::default() }
}

/// The short run of a target in the tests; nothing may fall.
pub(crate) fn short(target: &str, executions: u64) {
    let order = order(target, 1, executions, f64::MAX);
    let found = run(&order);
    println!("{}", row(&found));
    assert!(found.fell.is_empty(), "{:#?}", found.fell);
    assert_eq!(found.executions, executions);
    assert!(found.read > 0 && found.kinds > 1, "both ways are tried: {found:?}");
}

/// The targets of these names, or all.
fn named(names: &[String]) -> Vec<&'static str> {
    let is_chosen = |name: &&str| names.is_empty() || names.iter().any(|chosen| chosen == name);
    ALL.iter().map(|(name, _)| *name).filter(is_chosen).collect()
}

fn first_seed() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(1, |time| time.as_secs())
}

fn order(target: &str, seed: u64, executions: u64, seconds: f64) -> Order {
    let (target, limit) = (target.to_owned(), PATIENCE.as_secs_f64());
    Order { target, seed, executions, seconds, limit, folder: folder(), careful: false }
}

/// The run of so many seconds for each target, or each named one; in pieces, so that a piece can be repeated.
pub(crate) fn long(seconds: f64, names: &[String]) -> ExitCode {
    let (start, pieces) = (Instant::now(), if seconds > 120.0 { (seconds / 60.0) as u64 } else { 1 });
    let first = first_seed();
    println!("{HEADING}");
    let mut all = Found { target: "all".to_owned(), ..Found::default() };
    for name in named(names) {
        let mut whole = Found { target: name.to_owned(), ..Found::default() };
        for piece in 0..pieces {
            add(&mut whole, run(&order(name, first + piece, u64::MAX, seconds / pieces as f64)));
        }
        println!("{}", row(&whole));
        for (path, reason) in &whole.fell {
            println!("  FELL {}: {reason}", path.display());
        }
        add(&mut all, whole);
    }
    println!("{}", row(&all));
    println!("{:.2} hours, first seed {first}, {} fell", start.elapsed().as_secs_f64() / 3600.0, all.fell.len());
    ExitCode::from(u8::from(!all.fell.is_empty()))
}

fn add(whole: &mut Found, found: Found) {
    whole.executions += found.executions;
    whole.seconds += found.seconds;
    whole.read += found.read;
    whole.kinds = whole.kinds.max(found.kinds);
    whole.most_memory = whole.most_memory.max(found.most_memory);
    whole.largest_piece = whole.largest_piece.max(found.largest_piece);
    whole.longest_seconds = whole.longest_seconds.max(found.longest_seconds);
    whole.fell.extend(found.fell);
}

const HEADING: &str = "target         executions   a second    read  kinds   memory MiB  largest MiB  longest ms  fell";

fn row(found: &Found) -> String {
    let Found { target, executions, seconds, read, kinds, most_memory, largest_piece, longest_seconds, fell } = found;
    let mib = |bytes: &usize| *bytes as f64 / f64::from(1 << 20);
    format!(
        "{target:<14} {executions:>10} {:>10.0} {:>6.1}% {kinds:>6} {:>12.1} {:>12.1} {:>11.1} {:>5}",
        *executions as f64 / seconds.max(1.0e-9),
        100.0 * *read as f64 / (*executions).max(1) as f64,
        mib(most_memory),
        mib(largest_piece),
        1000.0 * longest_seconds,
        fell.len(),
    )
}

/// Each way of falling is noticed: by a target that only does that.
pub(crate) fn what_falls_is_found() {
    for (way, part) in [
        ("panics", "a panic of fuzzing"),
        ("hangs", "takes longer"),
        ("aborts", "signal"),
        ("devours", "it took"),
        ("lies", "not name"),
    ] {
        let found = run(&Order {
            target: format!("fall-{way}"),
            seed: 1,
            executions: 20_000,
            seconds: f64::MAX,
            // Ended sooner only where it is known to hang.
            limit: if way == "hangs" { 5.0 } else { PATIENCE.as_secs_f64() },
            folder: folder(),
            careful: false,
        });
        let said = found.fell.iter().find(|(_, reason)| reason.contains(part));
        let (path, reason) = said.unwrap_or_else(|| panic!("{way}: {found:?}"));
        let input = if way == "hangs" { path.with_file_name("fall-hangs-hangs") } else { path.clone() };
        let kept = fs::read(&input).unwrap_or_else(|error| panic!("{}: {error}: {reason}", input.display()));
        assert!(kept.starts_with(b"fall"), "{way}: the input is kept: {kept:?}");
    }
}
