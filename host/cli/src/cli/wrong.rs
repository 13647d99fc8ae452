//! The error of arguments that do not fit what a file or a build has.

use clap::error::ErrorKind;
use std::fmt::Display;

/// The exit code is that of wrong arguments.
pub fn wrong(message: impl Display) -> anyhow::Error {
    clap::Error::raw(ErrorKind::ArgumentConflict, format_args!("{message}\n\nFor more information, try '--help'.\n"))
        .into()
}

/// That this build lacks something, and how to get it.
pub(crate) fn not_built(what: &str, feature: &str) -> String {
    format!(
        "this build has no {what}; in the repository `cargo run --release --features {feature} -- ...` and \
         `cargo install --path host/cli --features {feature}` have it, elsewhere \
         `cargo install --git {} viewfuse-cli --features {feature}`",
        env!("CARGO_PKG_REPOSITORY")
    )
}
