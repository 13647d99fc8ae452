//! How busy the machine is, and with what: processor time of processes, on Linux.

use std::collections::HashMap;
use std::fs;

/// Ticks of processor time in a second, as `/proc` counts them.
const TICKS: f64 = 100.0;

/// Processor time that a process and all below it took so far, in seconds; 0 if there is no such process. What processes
/// below it took that ended is part of it once they were waited for.
pub fn processor_seconds(process: u32) -> f64 {
    family_ticks(&[process]) / TICKS
}

/// Ticks of processes and of all below them.
fn family_ticks(processes: &[u32]) -> f64 {
    let all: HashMap<u32, (u32, f64)> = fs::read_dir("/proc")
        .into_iter()
        .flatten()
        .flatten()
        .filter_map(|entry| {
            let id: u32 = entry.file_name().to_str()?.parse().ok()?;
            Some((id, ticks(&fs::read_to_string(entry.path().join("stat")).ok()?)?))
        })
        .collect();
    let is_of_family = |id: u32| {
        let mut own = Some(id);
        while let Some(id) = own {
            if processes.contains(&id) {
                return true;
            }
            own = all.get(&id).map(|(parent, _)| *parent);
        }
        false
    };
    all.iter().filter(|(id, _)| is_of_family(**id)).map(|(_, (_, ticks))| ticks).sum()
}

/// The parent, and user and system time with that of children that were waited for, of a line of `/proc/ID/stat`.
fn ticks(line: &str) -> Option<(u32, f64)> {
    // The second field is a name in parentheses, which may hold anything.
    let fields: Vec<&str> = line.rsplit_once(')')?.1.split_whitespace().collect();
    let times: Option<f64> = fields.get(11..15)?.iter().map(|field| field.parse::<f64>().ok()).sum();
    Some((fields.get(1)?.parse().ok()?, times?))
}

/// Busy and all ticks of the processors so far.
fn machine() -> Option<[f64; 2]> {
    let text = fs::read_to_string("/proc/stat").ok()?;
    let fields: Vec<f64> =
        text.lines().next()?.split_whitespace().skip(1).take(8).filter_map(|field| field.parse().ok()).collect();
    let idle: f64 = fields.get(3..5)?.iter().sum();
    let all: f64 = fields.iter().sum();
    Some([all - idle, all])
}

/// What the machine did from its beginning on.
pub struct Load {
    machine: Option<[f64; 2]>,
    own: f64,
}

impl Load {
    /// Begins to count. Of these processes, and of those below them, the time until now is not counted.
    pub fn begin(processes: &[u32]) -> Load {
        Load { machine: machine(), own: family_ticks(processes) }
    }

    /// The share of the machine's processor time since then that was not that of these processes and of those below them:
    /// the processes of the beginning, and any that are new. 1 where the system does not say.
    pub fn others(&self, processes: &[u32]) -> f64 {
        let (Some([busy, all]), Some([busy_now, all_now])) = (self.machine, machine()) else { return 1.0 };
        let own = family_ticks(processes) - self.own;
        ((busy_now - busy - own) / (all_now - all).max(1.0)).max(0.0)
    }
}
