//! Is every body of a kernel proven? The values of a body (constants, results of operators, indices) are changed by a
//! hundredth (an index by one), one after the other, until a test that reaches the place notices.
//!
//! ```text
//! cargo run --manifest-path tests/mutants/Cargo.toml -- make            compiles, lists what each test reaches
//! cargo run --manifest-path tests/mutants/Cargo.toml -- ask [MINUTES]   asks; goes on where it was left
//! cargo run --manifest-path tests/mutants/Cargo.toml -- table           which bodies nothing notices
//! ```
//!
//! The changes are compiled once: in a copy of the repository in `target/mutants` each value passes through a function
//! that changes it where an environment variable has the value's number.

mod copy;
mod places;
mod runs;

use places::Place;
use runs::{Outcome, Test};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::Write;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Changes of a body that are asked for at the most.
const MAX_CHANGES: usize = 12;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match &arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["make"] => make(),
        ["ask"] => ask(24 * 60),
        ["ask", minutes] => ask(minutes.parse().expect("minutes")),
        ["table"] => table(),
        _ => eprintln!("make, ask [MINUTES], or table"),
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
    fs::write(file("tests"), runs::list(&copy::build())).expect("a list of tests");
}

/// The bodies, of the kernels' crate and those of core that a case reaches, each with its changes: kinds in turn,
/// spread evenly over the body.
fn bodies<'a>(places: &'a [Place], tests: &[Test]) -> BTreeMap<&'a str, Vec<u32>> {
    let in_cases = tests.iter().filter(|test| test.is_case).flat_map(|test| &test.reached);
    let in_cases: BTreeSet<&str> = in_cases.map(|place| places[*place as usize].body.as_str()).collect();
    let mut kinds: BTreeMap<&str, BTreeMap<&str, Vec<u32>>> = BTreeMap::new();
    for (number, Place { body, kind, .. }) in (0..).zip(places) {
        if body.starts_with("kernels/") || in_cases.contains(body.as_str()) {
            kinds.entry(body).or_default().entry(kind).or_default().push(number);
        }
    }
    let spread = |kinds: BTreeMap<&str, Vec<u32>>| {
        let of_kind = MAX_CHANGES / kinds.len();
        let nth = |index| {
            let chosen = move |numbers: &Vec<u32>| {
                let count = numbers.len().min(of_kind);
                (index < count).then(|| numbers[index * numbers.len() / count])
            };
            kinds.values().filter_map(chosen).collect::<Vec<_>>()
        };
        (0..of_kind).flat_map(nth).collect()
    };
    kinds.into_iter().map(|(body, kinds)| (body, spread(kinds))).collect()
}

/// Asks until the time is over, and keeps a line for each body in the journal: how many changes were asked for, the
/// last one, and the test that noticed it, or `none`.
fn ask(minutes: u64) {
    let start = Instant::now();
    let text = fs::read_to_string(file("places")).expect("places: make comes first");
    let place = |line: &str| {
        let [body, kind, text] = line.splitn(3, '\t').collect::<Vec<_>>()[..] else { panic!("no place: {line}") };
        Place { body: body.to_owned(), kind: kind.to_owned(), text: text.to_owned() }
    };
    let places: Vec<Place> = text.lines().map(place).collect();
    let tests = runs::read(&fs::read_to_string(file("tests")).expect("tests: make comes first"));
    let known = fs::read_to_string(file("journal")).unwrap_or_default();
    let known: BTreeSet<&str> = known.lines().filter_map(|line| line.split('\t').next()).collect();
    let mut work = bodies(&places, &tests);
    work.retain(|body, _| !known.contains(body));
    println!("{} places, {} tests, {} bodies to ask for", places.len(), tests.len(), work.len());
    let work: Vec<(&str, Vec<u32>)> = work.into_iter().collect();
    let journal = fs::OpenOptions::new().create(true).append(true).open(file("journal")).expect("a journal");
    let (journal, next) = (Mutex::new(journal), AtomicUsize::new(0));
    let ask = || {
        while start.elapsed() < Duration::from_secs(60 * minutes) {
            let Some((body, changes)) = work.get(next.fetch_add(1, Ordering::Relaxed)) else { return };
            let answers = changes.iter().map(|change| noticed(&tests, *change));
            let found = (1..).zip(changes).zip(answers).find(|(_, answer)| answer.is_some());
            let ((asked, change), answer) =
                found.unwrap_or(((changes.len(), &changes[changes.len() - 1]), Some("none".to_owned())));
            let Place { kind, text, .. } = &places[*change as usize];
            let line = format!("{body}\t{asked}\t{kind} {text}\t{}\n", answer.unwrap_or_default());
            journal.lock().expect("a journal").write_all(line.as_bytes()).expect("a line");
        }
    };
    std::thread::scope(|scope| (0..2).for_each(|_| drop(scope.spawn(ask))));
    println!("{:.0} s", start.elapsed().as_secs_f64());
}

/// The first test that notices a change.
fn noticed(tests: &[Test], change: u32) -> Option<String> {
    let mut reaching = tests.iter().filter(|test| test.reached.contains(&change));
    let notices = |test: &&Test| {
        let limit = Duration::from_secs_f64(5.0 + 5.0 * test.seconds);
        runs::run(&test.binary, &test.name, change, None, limit) != Outcome::Passes
    };
    reaching.find(notices).map(|test| test.name.clone())
}

/// What was found, and the bodies of which no change is noticed.
fn table() {
    let journal = fs::read_to_string(file("journal")).expect("a journal: ask comes first");
    let lines: Vec<Vec<&str>> = journal.lines().map(|line| line.split('\t').collect()).collect();
    let unnoticed: Vec<_> = lines.iter().filter(|line| line[3] == "none").collect();
    println!(
        "{} bodies, {} noticed\n\n| body | changes | the last one |\n|---|---|---|",
        lines.len(),
        lines.len() - unnoticed.len()
    );
    unnoticed.iter().for_each(|line| println!("| `{}` | {} | {} |", line[0], line[1], line[2].replace('|', "\\|")));
}
