//! A process that feeds one target: it counts executions, time and memory, and keeps what fell.

use crate::change::{LONGEST, Random, changed};
use crate::memory;
use crate::targets::{Target, Verdict, named};
use serde::{Deserialize, Serialize};
use std::collections::HashSet;
use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};
use viewfuse_tests::command::files_below;
use viewfuse_tests::places::data;

/// Most bytes that reading a small file may take.
const MAX_MEMORY: usize = 256 << 20;
/// Inputs that are kept because they led to something new, at most.
const MAX_KEPT: usize = 1024;
/// A target that fell so many times is left.
const MAX_FALLS: usize = 10;

/// What a worker does.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Order {
    pub(crate) target: String,
    pub(crate) seed: u64,
    /// It ends after so many executions, or so many seconds.
    pub(crate) executions: u64,
    pub(crate) seconds: f64,
    /// An execution that takes so many seconds hangs.
    pub(crate) limit: f64,
    /// Where inputs that fell are kept.
    pub(crate) folder: PathBuf,
    /// Keeps every input before it is tried: for those that end the process.
    pub(crate) careful: bool,
}

/// What a worker found.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Found {
    pub(crate) target: String,
    pub(crate) executions: u64,
    pub(crate) seconds: f64,
    /// Inputs that were read, of all.
    pub(crate) read: u64,
    /// Different outcomes: messages without their numbers and words.
    pub(crate) kinds: usize,
    /// Most memory taken at once, and the largest piece, of one execution.
    pub(crate) most_memory: usize,
    pub(crate) largest_piece: usize,
    pub(crate) longest_seconds: f64,
    /// What fell: the file with the input, and why.
    pub(crate) fell: Vec<(PathBuf, String)>,
}

/// The input that is being tried, for the watchdog, and when it began, in milliseconds from the start; 0 between
/// inputs.
static CURRENT: Mutex<Vec<u8>> = Mutex::new(Vec::new());
static BEGAN: AtomicU64 = AtomicU64::new(0);
/// What the last panic said.
static PANIC: Mutex<String> = Mutex::new(String::new());

/// The file that a careful worker keeps its input in.
pub(crate) const LAST: &str = "last";

/// Ends the process when an execution takes too long.
fn watch(order: &Order, start: Instant) {
    let (limit, path) = ((1000.0 * order.limit) as u64, order.folder.join(format!("{}-hangs", order.target)));
    std::thread::spawn(move || {
        loop {
            sleep(Duration::from_millis(100));
            let began = BEGAN.load(Ordering::SeqCst);
            if began > 0 && start.elapsed().as_millis() as u64 > began + limit {
                if let Ok(input) = CURRENT.lock() {
                    let _ = fs::write(&path, &*input);
                }
                eprintln!("an input takes longer than {limit} ms: {}", path.display());
                std::process::exit(9);
            }
        }
    });
}

/// A message without what differs from input to input: numbers, and names in quotes.
fn kind(verdict: &Verdict) -> u64 {
    let mut hasher = DefaultHasher::new();
    match verdict {
        Verdict::Read => 0.hash(&mut hasher),
        Verdict::Refused(message) => {
            for piece in message.split(['"', '\'']).step_by(2) {
                piece
                    .chars()
                    .filter(|character| character.is_alphabetic())
                    .take(80)
                    .for_each(|one| one.hash(&mut hasher));
            }
        }
    }
    hasher.finish()
}

/// Inputs that once fell, of a target.
pub(crate) fn corpus(target: &str) -> Vec<Vec<u8>> {
    let folder = data("fuzz").join("fell").join(target);
    if !folder.is_dir() {
        return Vec::new();
    }
    files_below(&folder).into_iter().map(|(path, _)| fs::read(path).expect("an input")).collect()
}

/// Does what is ordered and prints what was found, as JSON on a line.
pub(crate) fn work(order: &Order) {
    std::panic::set_hook(Box::new(|panic| {
        if let Ok(mut said) = PANIC.lock() {
            *said = panic.to_string().replace('\n', " ");
        }
    }));
    let start = Instant::now();
    watch(order, start);
    let mut target = named(&order.target);
    let mut worker = Worker { order, start, found: Found { target: order.target.clone(), ..Found::default() } };
    worker.run(target.as_mut());
    println!("{}", serde_json::to_string(&worker.found).expect("JSON"));
}

struct Worker<'a> {
    order: &'a Order,
    start: Instant,
    found: Found,
}

impl Worker<'_> {
    fn run(&mut self, target: &mut dyn Target) {
        let mut random = Random(self.order.seed);
        let (mut kinds, words) = (HashSet::new(), target.words());
        let mut kept = target.seeds();
        for seed in &kept {
            match self.attempt(target, seed) {
                Some(verdict) => kinds.insert(kind(&verdict)),
                None => return,
            };
        }
        let seed_count = kept.len();
        for input in corpus(&self.order.target) {
            if let Some(verdict) = self.attempt(target, &input) {
                kinds.insert(kind(&verdict));
            }
            kept.push(input);
        }
        while !self.is_over() {
            // Half of the time from what is right.
            let from = if random.below(2) == 0 { random.below(seed_count) } else { random.below(kept.len()) };
            let other = random.below(kept.len());
            let mut input = changed(&kept[from], &kept[other], words, &mut random);
            if random.below(4) > 0 {
                input = target.repaired(input);
            }
            if let Some(verdict) = self.attempt(target, &input)
                && kinds.insert(kind(&verdict))
                && kept.len() < MAX_KEPT
                && input.len() < LONGEST / 4
            {
                kept.push(input);
            }
        }
        self.found.kinds = kinds.len();
        self.found.seconds = self.start.elapsed().as_secs_f64();
    }

    fn is_over(&self) -> bool {
        let Found { executions, fell, .. } = &self.found;
        *executions >= self.order.executions
            || self.start.elapsed().as_secs_f64() >= self.order.seconds
            || fell.len() >= MAX_FALLS
    }

    /// Tries an input; `None` if it fell.
    fn attempt(&mut self, target: &mut dyn Target, input: &[u8]) -> Option<Verdict> {
        if self.order.careful {
            fs::write(self.order.folder.join(LAST), input).expect("a file");
        }
        if let Ok(mut current) = CURRENT.lock() {
            current.clear();
            current.extend_from_slice(input);
        }
        let before = memory::start();
        let begin = Instant::now();
        BEGAN.store(1 + self.start.elapsed().as_millis() as u64, Ordering::SeqCst);
        let outcome = catch_unwind(AssertUnwindSafe(|| target.run(input)));
        BEGAN.store(0, Ordering::SeqCst);
        let seconds = begin.elapsed().as_secs_f64();
        let [peak, largest] = memory::since_start();
        let taken = peak.saturating_sub(before);
        let found = &mut self.found;
        found.executions += 1;
        found.most_memory = found.most_memory.max(taken);
        found.largest_piece = found.largest_piece.max(largest);
        found.longest_seconds = found.longest_seconds.max(seconds);
        let reason = match outcome {
            Err(_) => PANIC.lock().map_or_else(|_| "a panic".to_owned(), |said| said.clone()),
            Ok(Err(fault)) => fault,
            Ok(Ok(_)) if taken > MAX_MEMORY => format!("it took {} MiB", taken >> 20),
            Ok(Ok(verdict)) => {
                found.read += u64::from(verdict == Verdict::Read);
                return Some(verdict);
            }
        };
        let path = self.order.folder.join(format!("{}-{}", self.order.target, found.executions));
        keep(&path, input);
        self.found.fell.push((path, reason));
        None
    }
}

fn keep(path: &Path, input: &[u8]) {
    fs::write(path, input).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
}
