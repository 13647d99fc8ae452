//! Is every body of a kernel proven? Each value in a body (a constant, the result of an operator, an index) is changed
//! by a hundredth (an index by one), one after the other, and the tests that reach it are asked whether they notice.
//!
//! ```text
//! cargo run --manifest-path tests/mutants/Cargo.toml -- make                  compiles, lists what each test reaches
//! cargo run --manifest-path tests/mutants/Cargo.toml -- list BINARY...         lists those of some binaries alone, in less time
//! cargo run --manifest-path tests/mutants/Cargo.toml -- ask NAME [MINUTES]    asks; goes on where it was left
//! cargo run --manifest-path tests/mutants/Cargo.toml -- table NAME            the answers of a run
//! ```
//!
//! The changes are compiled once: in a copy of the repository in `target/mutants` each value passes through a function
//! that changes it where an environment variable has the value's number. Of a body at most [`MAX_CHANGES`] places of a
//! kind are changed, spread evenly.

mod copy;
mod places;
mod runs;
mod table;

use copy::Binary;
use places::Place;
use runs::{Outcome, Test};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::Write;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Changes of a body and kind.
const MAX_CHANGES: usize = 2;
/// Groups of tests, which are asked one after the other: the cases on the CPU, those of the bodies themselves, and
/// others.
const GROUPS: [&str; 3] = ["case", "bodies", "numerics"];

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match &arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["make"] => make(),
        ["list", names @ ..] => list(names),
        ["ask", name] => ask(name, 24 * 60),
        ["ask", name, minutes] => ask(name, minutes.parse().expect("minutes")),
        ["table", name] => print!("{}", table::table(name)),
        _ => eprintln!("make, list BINARY..., ask NAME [MINUTES], or table NAME"),
    }
}

/// A file beside the copy.
fn file(name: &str) -> PathBuf {
    copy::repository().join("target").join(format!("mutants-{name}.txt"))
}

fn make() {
    let places = copy::make();
    let lines = places.iter().map(|Place { body, kind, text }| format!("{body}\t{kind}\t{text}\n"));
    fs::write(file("places"), lines.collect::<String>()).expect("a list of places");
    let binaries = copy::build();
    let lines = binaries.iter().map(|Binary { name, path }| format!("{name}\t{}\n", path.display()));
    fs::write(file("binaries"), lines.collect::<String>()).expect("a list of binaries");
    list(&copy::BINARIES);
}

/// Lists what the tests of some binaries reach.
fn list(names: &[&str]) {
    let text = fs::read_to_string(file("binaries")).expect("binaries: make comes first");
    let binary = |line: &str| {
        let (name, path) = line.split_once('\t').expect("a binary");
        Binary { name: name.to_owned(), path: PathBuf::from(path) }
    };
    let binaries: Vec<Binary> =
        text.lines().map(binary).filter(|binary| names.contains(&binary.name.as_str())).collect();
    fs::write(file("tests"), runs::list(&binaries)).expect("a list of tests");
}

/// Places that are changed: some of each kind in a body, of the kernels' crate and of what cases reach in core.
fn chosen(places: &[Place], tests: &[Test]) -> Vec<u32> {
    let cases = tests.iter().filter(|test| ["case", "bodies"].contains(&test.group.as_str()));
    let in_cases = cases.flat_map(|test| &test.reached);
    let of_kernels: BTreeSet<&str> = in_cases.map(|place| places[*place as usize].body.as_str()).collect();
    let mut of_bodies: BTreeMap<(&str, &str), Vec<u32>> = BTreeMap::new();
    for (number, Place { body, kind, .. }) in (0..).zip(places) {
        if body.starts_with("kernels/") || of_kernels.contains(body.as_str()) {
            of_bodies.entry((body, kind)).or_default().push(number);
        }
    }
    // Some of each body come first, then more of each.
    let mut rounds: Vec<Vec<u32>> = vec![Vec::new(); 3 * MAX_CHANGES];
    let mut of_body: BTreeMap<&str, usize> = BTreeMap::new();
    for ((body, _), numbers) in of_bodies {
        let count = numbers.len().min(MAX_CHANGES);
        for index in 0..count {
            let round = of_body.entry(body).or_default();
            rounds[*round].push(numbers[index * numbers.len() / count]);
            *round += 1;
        }
    }
    rounds.concat()
}

/// Asks until the time is over, and keeps each answer in the journal of the run: place, then an answer of each group.
fn ask(name: &str, minutes: u64) {
    let start = Instant::now();
    let text = fs::read_to_string(file("places")).expect("places: make comes first");
    let place = |line: &str| {
        let [body, kind, text] = line.splitn(3, '\t').collect::<Vec<_>>()[..] else { panic!("no place: {line}") };
        Place { body: body.to_owned(), kind: kind.to_owned(), text: text.to_owned() }
    };
    let places: Vec<Place> = text.lines().map(place).collect();
    let tests = runs::read(&fs::read_to_string(file("tests")).expect("tests: make comes first"));
    let known = fs::read_to_string(file(name)).unwrap_or_default();
    let known: BTreeSet<&str> = known.lines().filter_map(|line| line.rsplitn(GROUPS.len() + 1, '\t').last()).collect();
    let key = |number: u32| {
        let Place { body, kind, text } = &places[number as usize];
        format!("{body} {kind} {text}")
    };
    let mut work = chosen(&places, &tests);
    work.retain(|number| !known.contains(key(*number).as_str()));
    println!("{} places, {} tests, {} changes to ask for", places.len(), tests.len(), work.len());
    let journal = fs::OpenOptions::new().create(true).append(true).open(file(name)).expect("a journal");
    let (journal, next) = (Mutex::new(journal), AtomicUsize::new(0));
    let ask = || {
        while start.elapsed() < Duration::from_secs(60 * minutes) {
            let Some(number) = work.get(next.fetch_add(1, Ordering::Relaxed)) else { return };
            let answers = GROUPS.map(|group| noticed(&tests, group, *number));
            let line = format!("{}\t{}\n", key(*number), answers.join("\t"));
            journal.lock().expect("a journal").write_all(line.as_bytes()).expect("a line");
        }
    };
    std::thread::scope(|scope| (0..2).for_each(|_| drop(scope.spawn(ask))));
    let done = next.into_inner().min(work.len());
    println!("asked for {done} of {} in {:.0} s", work.len(), start.elapsed().as_secs_f64());
}

/// The first test of a group that notices a change; `none` of those that reach it, or `not reached`.
fn noticed(tests: &[Test], group: &str, change: u32) -> String {
    let mut answer = "not reached";
    for test in tests.iter().filter(|test| test.group == group && test.reached.contains(&change)) {
        let limit = Duration::from_secs_f64(5.0 + 5.0 * test.seconds);
        match runs::run(&test.binary, &test.name, change, None, limit) {
            Outcome::Passes => answer = "none",
            Outcome::Fails | Outcome::Hangs => return test.name.clone(),
        }
    }
    answer.to_owned()
}
