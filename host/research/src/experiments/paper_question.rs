//! The paper's question over fields: what weighting by cameras gains over the mean, by field and number of sources.
//!
//! `cargo run --release -p viewfuse-research -- paper_question FIGURE NAME:PART=FOLDER...`
//!
//! Each folder is one of `evaluate --protocol -o`, finished. Folders of one name and field become one table: a column for each
//! number of sources, a row for each scheme, the mean's score and what the others gain over it, with 95 % intervals over scenes.
//! The scenes of folders of one part are the same, in one order; those of other parts are others. Protocols that draw nothing
//! become one column, each scene by its own protocol. The figure has the gain of `error:alpha=1`, and the paper's own.

mod figure;

use anyhow::{Context, bail, ensure};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;
use viewfuse_evaluate::PSNR;
use viewfuse_evaluate::metrics::interval::Interval;
use viewfuse_evaluate::protocol::Protocol;
use viewfuse_evaluate::run_folder::{Finished, RunFolder, missing};
use viewfuse_evaluate::summary::{Observation, REFERENCE, Table, table};
use viewfuse_job::files::write_whole;

/// The scheme that the paper recommends, which the figure shows.
pub(crate) const ERROR: &str = "error:alpha=1";

/// What the paper reports of [`ERROR`] over the mean on SRN's cars with the published networks, decibels: by field and column.
pub(crate) const PAPER: [(&str, &[(Column, f64)]); 2] = [
    ("pixelnerf", &[(Column::Count(3), 0.75), (Column::Close, 1.34), (Column::Count(32), 2.08)]),
    ("genvs", &[(Column::Count(3), 0.81), (Column::Close, 5.99), (Column::Count(32), 1.93)]),
];

/// More scenes than a part has.
const MAX_SCENES: usize = 1_000_000;

/// How the sources are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Column {
    /// So many at random.
    Count(usize),
    /// Five, one of them close.
    Close,
    /// By each scene's own protocol.
    Own,
}

impl Column {
    /// Five with a close one stand between three and eight.
    fn place(self) -> usize {
        match self {
            Column::Count(count) => 2 * count,
            Column::Close => 11,
            Column::Own => usize::MAX,
        }
    }

    pub(crate) fn label(self) -> String {
        match self {
            Column::Count(count) => format!("{count}"),
            Column::Close => "5, one close".to_owned(),
            Column::Own => "own protocol".to_owned(),
        }
    }
}

/// A field's tables on some scenes.
pub(crate) struct Group {
    /// The scenes.
    pub(crate) name: String,
    /// The field.
    pub(crate) field: String,
    /// Finished jobs by column, with scenes that are counted through all parts.
    jobs: BTreeMap<usize, (Column, Vec<Finished>)>,
    parts: Vec<String>,
}

impl Group {
    /// The tables, by ascending number of sources.
    pub(crate) fn tables(&self) -> Vec<(Column, Table)> {
        let of = |(column, jobs): &(Column, Vec<Finished>)| {
            let observations: Vec<Observation<'_>> = jobs
                .iter()
                .enumerate()
                .flat_map(|(number, job)| {
                    job.scores.iter().map(move |score| Observation { scene: job.scene, job: number, score })
                })
                .collect();
            (*column, table(&observations))
        };
        self.jobs.values().map(of).collect()
    }

    /// The name of the field and its network.
    pub(crate) fn title(&self) -> String {
        format!("{}, {}", self.name, self.field)
    }
}

/// The difference of a scheme from the mean; for the mean itself the score.
pub(crate) fn cell(table: &Table, scheme: &str) -> Option<Interval> {
    // Tables of masked benchmarks have another headline.
    let psnr = table.metrics.iter().position(|metric| metric.name == PSNR)?;
    let cell = table.rows.iter().find(|row| row.scheme == scheme)?.cells.get(psnr)?.as_ref()?;
    if scheme == REFERENCE { Some(cell.value) } else { cell.versus_reference }
}

pub(crate) fn run(arguments: &[String]) -> anyhow::Result<()> {
    let [figure_path, folders @ ..] = arguments else {
        bail!("usage: paper_question FIGURE NAME:PART=FOLDER...");
    };
    let mut groups: Vec<Group> = Vec::new();
    for folder in folders {
        let (names, folder) = folder.split_once('=').context("a folder is NAME:PART=FOLDER")?;
        let (name, part) = names.split_once(':').context("a folder is NAME:PART=FOLDER")?;
        add(&mut groups, name, part, Path::new(folder)).with_context(|| folder.to_owned())?;
    }
    let text: String = groups.iter().map(group_text).collect::<Vec<_>>().join("\n");
    write_whole(Path::new(figure_path), figure::svg(&groups)?.as_bytes())?;
    print!("{text}");
    Ok(())
}

/// Adds a folder to its group.
fn add(groups: &mut Vec<Group>, name: &str, part: &str, path: &Path) -> anyhow::Result<()> {
    let folder = RunFolder::open(path)?;
    let settings = folder.settings();
    let finished = folder.finished()?;
    let missing = missing(settings.job_count, &finished).len();
    ensure!(missing == 0, "{missing} jobs are not finished");
    let protocol: Protocol = settings.protocol.parse()?;
    let at = groups.iter().position(|group| group.name == name && group.field == settings.field);
    let at = at.unwrap_or_else(|| {
        let (name, field) = (name.to_owned(), settings.field.clone());
        groups.push(Group { name, field, jobs: BTreeMap::new(), parts: Vec::new() });
        groups.len() - 1
    });
    let group = &mut groups[at];
    let place = group.parts.iter().position(|own| own == part).unwrap_or_else(|| {
        group.parts.push(part.to_owned());
        group.parts.len() - 1
    });
    for mut job in finished.into_values() {
        let column = match &protocol {
            Protocol::Close { .. } => Column::Close,
            protocol if protocol.draws() => Column::Count(job.sources.len()),
            _ => Column::Own,
        };
        job.scene += place * MAX_SCENES;
        group.jobs.entry(column.place()).or_insert((column, Vec::new())).1.push(job);
    }
    Ok(())
}

/// A group as text.
fn group_text(group: &Group) -> String {
    let tables = group.tables();
    let mut schemes: Vec<&str> = Vec::new();
    for (_, table) in &tables {
        for row in &table.rows {
            if !schemes.contains(&row.scheme.as_str()) {
                schemes.push(&row.scheme);
            }
        }
    }
    let heads: Vec<String> = tables.iter().map(|(column, _)| column.label()).collect();
    let counts = |count: fn(&Table) -> usize| -> Vec<String> {
        tables.iter().map(|(_, table)| count(table).to_string()).collect()
    };
    let mut text =
        format!("### {}\n\n| sources | {} |\n|---|{}\n", group.title(), heads.join(" | "), "---|".repeat(heads.len()));
    let _ = writeln!(text, "| scenes | {} |", counts(|table| table.scene_count).join(" | "));
    let _ = writeln!(text, "| pictures | {} |", counts(|table| table.target_count).join(" | "));
    for scheme in schemes {
        let value = |table: &Table| match cell(table, scheme) {
            Some(value) if scheme == REFERENCE => format!("{value:.2}"),
            Some(value) if value.excludes_zero() => format!("**{}{value:.2}**", sign(value.mean)),
            Some(value) => format!("{}{value:.2}", sign(value.mean)),
            None => String::new(),
        };
        let values: Vec<String> = tables.iter().map(|(_, table)| value(table)).collect();
        let _ = writeln!(text, "| `{scheme}` | {} |", values.join(" | "));
    }
    if let Some((_, paper)) = PAPER.iter().find(|(field, _)| group.field.to_lowercase().contains(field)) {
        let of = |column: &Column| {
            paper.iter().find(|(own, _)| own == column).map_or(String::new(), |(_, gain)| format!("{gain:+.2}"))
        };
        let values: Vec<String> = tables.iter().map(|(column, _)| of(column)).collect();
        let _ = writeln!(text, "| the paper, `{ERROR}`, SRN's cars | {} |", values.join(" | "));
    }
    text
}

fn sign(value: f64) -> &'static str {
    if value < 0.0 { "" } else { "+" }
}
