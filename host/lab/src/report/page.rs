//! The whole page.

use super::{Report, ReportError};
use maud::{DOCTYPE, Markup, PreEscaped, html};

/// Only the page's own content is allowed.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; img-src data:";

/// The page as HTML.
pub fn page(report: &Report) -> Result<String, ReportError> {
    let Report { title, evaluations, sweeps, trainings } = report;
    // Heading and body of every section; its place is its address on the page.
    let mut sections: Vec<(String, Markup)> = Vec::new();
    let id = |sections: &Vec<_>| format!("section-{}", sections.len() + 1);
    for evaluation in evaluations {
        sections.push((evaluation.entry(), evaluation.section(&id(&sections))?));
    }
    for sweep in sweeps {
        sections.push((sweep.title(), sweep.section(&id(&sections))?));
    }
    for training in trainings {
        sections.push((training.title(), training.section(&id(&sections))));
    }
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                meta name="generator" content="viewfuse";
                title { (title) }
                link rel="icon" href="data:,";
                style { (PreEscaped(include_str!("style.css"))) }
            }
            body {
                header {
                    h1 { (title) }
                    p { "Few-shot novel view synthesis with camera-weighted fusion; made by \
                        viewfuse " (env!("CARGO_PKG_VERSION")) "." }
                    @if sections.len() > 1 {
                        nav { ul {
                            @for (index, (title, _)) in sections.iter().enumerate() {
                                li { a href={ "#section-" (index + 1) } { (title) } }
                            }
                        } }
                    }
                }
                main { @for (_, section) in &sections { (section) } }
            }
        }
    };
    Ok(page.into_string())
}
