//! core's feature `defmt`: every public error and value can be logged on a microcontroller.

use libtest_mimic::Failed;
use std::path::Path;
use std::process::Command;
use viewfuse_tests::places::repository;
use viewfuse_tests::source::files;

/// Thousands of parameters, which nobody logs.
const PARAMETERS: [&str; 7] = [
    "Linear", "FourierEmbedding", "FlatEmbedding", "LearnedCrossAttention", "PoseSelfAttention", "QuantisedLinear",
    "QuantisedAttention",
];
const DERIVED: &str = "derive(defmt::Format)";

viewfuse_tests::trials![every_value_has_a_format, the_formats_compile,];

/// Public types of a source that derive `Debug`, and whether they derive `Format`.
fn values(source: &str) -> Vec<(String, bool)> {
    let lines: Vec<&str> = source.lines().map(str::trim).collect();
    let mut values = Vec::new();
    for (index, line) in lines.iter().enumerate() {
        if !(line.starts_with("#[derive(") && line.contains("Debug")) {
            continue;
        }
        let attributes = lines[index..].iter().take_while(|line| line.starts_with('#')).count();
        let declared = lines.get(index + attributes).copied().unwrap_or_default();
        let Some(rest) = declared.strip_prefix("pub struct ").or_else(|| declared.strip_prefix("pub enum ")) else {
            continue;
        };
        let name: String = rest.chars().take_while(|character| character.is_alphanumeric()).collect();
        // Blocks are what kernels read.
        if !name.ends_with("Block") && !PARAMETERS.contains(&name.as_str()) {
            let has_format = lines[index..index + attributes].iter().any(|line| line.contains(DERIVED));
            values.push((name, has_format));
        }
    }
    values
}

fn every_value_has_a_format() -> Result<(), Failed> {
    let mut count = 0;
    for path in files(&repository().join("core/src"), "rs") {
        for (name, has_format) in values(&std::fs::read_to_string(&path)?) {
            assert!(has_format, "{}: {name} lacks #[cfg_attr(feature = \"defmt\", {DERIVED})]", path.display());
            count += 1;
        }
    }
    assert!(count > 35, "{count} types");
    Ok(())
}

/// Checked for the host: the code is the same for every target.
fn the_formats_compile() -> Result<(), Failed> {
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["check", "--quiet", "--locked", "--package", "viewfuse-formats", "--target-dir"]);
    cargo.arg(Path::new(env!("CARGO_TARGET_TMPDIR")).join("firmware"));
    let output = cargo.current_dir(repository().join("tests/firmware")).output()?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into_owned().into());
    }
    Ok(())
}
