//! The table: a row for each variant.

use super::candidates::Candidates;
use super::variants::SEEDS;
use std::fmt::Write;
use viewfuse_evaluate::metrics::interval::Interval;

/// The group that decides.
pub(crate) const PHOTOGRAPHS: &str = "photographs";
/// A variant could be part of the field if its worst scene loses no more than this, decibels, and the interval of the mean over
/// photographs is above zero.
const MIN_WORST: f64 = -0.3;

/// A scene with its pictures.
pub(crate) struct Job {
    pub(crate) group: String,
    pub(crate) name: String,
    pub(crate) protocol: String,
    pub(crate) pictures: Vec<Candidates>,
}

/// What a variant gains.
pub(crate) struct Measured {
    pub(crate) name: &'static str,
    pub(crate) parameters: usize,
    /// Decibels over the field, `[seed][job]`: means over pictures.
    pub(crate) gains: Vec<Vec<f64>>,
}

impl Measured {
    /// The gains on the scenes of a group: means over seeds.
    fn of_group(&self, group: &str, jobs: &[Job]) -> Vec<f64> {
        let mean = |job: usize| self.gains.iter().map(|own| own[job]).sum::<f64>() / self.gains.len().max(1) as f64;
        (0..jobs.len()).filter(|job| jobs[*job].group == group).map(mean).collect()
    }
}

/// The table as text, and which variants could be part of the field.
pub(crate) fn table(measured: &[Measured], jobs: &[Job]) -> String {
    let mut groups: Vec<&str> = Vec::new();
    jobs.iter().for_each(|job| {
        if !groups.contains(&job.group.as_str()) {
            groups.push(&job.group);
        }
    });
    let photographs: Vec<usize> = (0..jobs.len()).filter(|job| jobs[*job].group == PHOTOGRAPHS).collect();
    let mut text = "| gain over the field, dB | parameters |".to_owned();
    for group in &groups {
        let count = jobs.iter().filter(|job| job.group == *group).count();
        let _ = write!(text, " {group} ({count} scenes) | each seed | worst |");
    }
    photographs.iter().for_each(|job| text += &format!(" {} |", jobs[*job].name));
    text += &format!("\n|---|{}\n", "---|".repeat(1 + 3 * groups.len() + photographs.len()));
    let mut kept = Vec::new();
    for own in measured {
        let _ = write!(text, "| {} | {} |", own.name, own.parameters);
        let mut is_kept = false;
        let mut least = f64::MAX;
        for group in &groups {
            let gains = own.of_group(group, jobs);
            let worst = gains.iter().copied().fold(f64::MAX, f64::min);
            least = least.min(worst);
            let Some(interval) = Interval::of(&gains) else { continue };
            let seeds: Vec<String> = (0..SEEDS.len().min(own.gains.len()))
                .map(|seed| {
                    let gains =
                        own.gains[seed].iter().zip(jobs).filter(|(_, job)| job.group == *group).map(|(gain, _)| *gain);
                    Interval::of(&gains.collect::<Vec<_>>()).map_or(String::new(), |own| format!("{:+.2}", own.mean))
                })
                .collect();
            let mark = if interval.excludes_zero() { "**" } else { "" };
            let _ = write!(
                text,
                " {mark}{}{interval:.2}{mark} | {} | {worst:+.2} |",
                plus(interval.mean),
                seeds.join(", ")
            );
            is_kept |= *group == PHOTOGRAPHS && interval.mean > 0.0 && interval.excludes_zero();
        }
        photographs.iter().for_each(|job| {
            let mean = own.gains.iter().map(|gains| gains[*job]).sum::<f64>() / own.gains.len().max(1) as f64;
            let _ = write!(text, " {mean:+.2} |");
        });
        text.push('\n');
        if is_kept && least >= MIN_WORST {
            kept.push(own.name);
        }
    }
    let kept = if kept.is_empty() { "none".to_owned() } else { kept.join("; ") };
    let _ = write!(
        text,
        "\nBetter than the field on photographs beyond the interval, and on no scene worse than {MIN_WORST} dB: {kept}\n"
    );
    text
}

/// The sign that a number above zero is shown with.
fn plus(value: f64) -> &'static str {
    if value >= 0.0 { "+" } else { "" }
}
