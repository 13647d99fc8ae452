//! The result of a run as a table.

use crate::{GROUPS, file};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Answers of the groups, by body, then by change.
type Answers = BTreeMap<String, BTreeMap<String, Vec<String>>>;

fn read(name: &str) -> Answers {
    let mut answers = Answers::new();
    for line in std::fs::read_to_string(file(name)).expect("a run").lines() {
        let mut columns: Vec<String> = line.rsplitn(GROUPS.len() + 1, '\t').map(str::to_owned).collect();
        let key = columns.pop().expect("a change");
        columns.reverse();
        let (body, change) = key.split_once(' ').expect("a body");
        answers.entry(body.to_owned()).or_default().insert(change.to_owned(), columns);
    }
    answers
}

fn is_noticed(answer: &str) -> bool {
    !["none", "not reached"].contains(&answer)
}

/// How many changes of a body some groups notice.
fn count(changes: &BTreeMap<String, Vec<String>>, groups: &[usize]) -> usize {
    changes.values().filter(|answers| groups.iter().any(|group| is_noticed(&answers[*group]))).count()
}

/// A line a body, then the changes that no test notices which is still there.
pub fn table(name: &str) -> String {
    let mut text = String::from("| body | changes | case | bodies | numerics | all |\n|---|---|---|---|---|---|\n");
    let answers = read(name);
    let (mut sums, mut unnoticed, mut lost) = ([0; 5], String::new(), Vec::new());
    for (body, changes) in &answers {
        let groups = [&[0][..], &[1], &[2], &[0, 1, 2]];
        let counts: Vec<usize> = groups.iter().map(|groups| count(changes, groups)).collect();
        let row = [&[changes.len()][..], &counts].concat();
        row.iter().zip(&mut sums).for_each(|(count, sum)| *sum += count);
        let cells: Vec<String> = row.iter().map(usize::to_string).collect();
        writeln!(text, "| `{body}` | {} |", cells.join(" | ")).expect("a text");
        if row[4] == 0 {
            lost.push(body.as_str());
        }
        for (change, answers) in changes.iter().filter(|(_, answers)| !answers.iter().any(|answer| is_noticed(answer)))
        {
            let reach = match answers.iter().all(|answer| answer == "not reached") {
                true => "reached by none",
                false => "noticed by none",
            };
            writeln!(unnoticed, "| `{body}` | {} | {reach} |", change.replace('|', "\\|")).expect("a text");
        }
    }
    let cells: Vec<String> = sums.iter().map(usize::to_string).collect();
    writeln!(text, "| all {} | {} |", answers.len(), cells.join(" | ")).expect("a text");
    writeln!(text, "\nBodies of which no change is noticed: {lost:?}\n").expect("a text");
    text + "| body | kind, line, expression | |\n|---|---|---|\n" + &unnoticed
}
