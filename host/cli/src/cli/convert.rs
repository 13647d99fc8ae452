//! `viewfuse convert`.

use super::outputs::{foreign, keep_others};
use super::printing::say;
use super::table::table;
use super::terminal::Terminal;
use anyhow::{bail, ensure};
use clap::Args;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use viewfuse_core::half_precision::{f16_bits, f16_value};
use viewfuse_field::{genvs, pixelnerf};
use viewfuse_job::files::{check_writable, write_whole};
use viewfuse_job::progress::Progress;
use viewfuse_nn::checkpoint::{Checkpoint, Precision};
use viewfuse_weighting::attention::quantised::{quantised, rust_source};
use viewfuse_weighting::attention::{AttentionModel, c_header};

#[derive(Args)]
#[command(after_help = "Examples:\n  viewfuse convert pixel_nerf_latest pixelnerf.safetensors --half\n  \
    viewfuse convert weighting.safetensors attention.h\n      learned attention, for firmware that links the C face\n  \
    viewfuse convert weighting.safetensors attention.rs\n      the same with 8 bits a weight, for firmware in Rust\n\n\
    Input formats are safetensors, torch.save (new and old), and networks written by Python's pickle (.pkl), such as \
    snapshots of EDM's training. No code in a file is executed.")]
pub(crate) struct Arguments {
    /// The checkpoint
    input: PathBuf,
    /// The output, as safetensors; for learned attention with the Fourier embedding also a C header, or Rust with 8
    /// bits
    #[arg(value_name = "OUT.safetensors|OUT.h|OUT.rs")]
    output: PathBuf,
    /// Round floating point numbers to half precision (f16)
    #[arg(long)]
    half: bool,
    /// Say in the output's metadata what the checkpoint does not say of itself; of a PixelNeRF viewfuse.first_pool,
    /// whether its trunk has a max pool (0 or 1), viewfuse.source_side, the longest side of its sources in pixels, and
    /// viewfuse.pixel_centre, where in a pixel its centre is (0 or 0.5)
    #[arg(long, value_name = "KEY=VALUE", value_parser = setting)]
    set: Vec<(String, String)>,
}

/// All keys that `--set` takes: those that a reader of checkpoints looks at.
fn keys() -> impl Iterator<Item = &'static str> {
    pixelnerf::KEYS.into_iter().chain(genvs::KEYS)
}

/// A value of `--set`.
fn setting(text: &str) -> Result<(String, String), String> {
    let parts = text.split_once('=').filter(|(key, value)| !key.is_empty() && !value.is_empty());
    let (key, value) = parts.ok_or("a key and a value, for example viewfuse.first_pool=0")?;
    if !keys().any(|known| known == key) {
        return Err(format!("nothing reads the key {key}; those that exist are {}", Vec::from_iter(keys()).join(", ")));
    }
    Ok((key.to_owned(), value.to_owned()))
}

/// Refuses what is set and would not be understood, or not be read: keys of another network.
fn check_settings(checkpoint: &Checkpoint, set: &[(String, String)]) -> anyhow::Result<()> {
    let Some((key, _)) = set.first() else { return Ok(()) };
    let keys: &[&str] = match (pixelnerf::Architecture::of(checkpoint), genvs::Architecture::of(checkpoint)) {
        (Ok(_), _) => &pixelnerf::KEYS,
        (_, Ok(_)) => &genvs::KEYS,
        // The value is of a network that it fits, which says what is wrong.
        (Err(error), _) if pixelnerf::KEYS.contains(&key.as_str()) => return Err(error.into()),
        (_, Err(error)) => return Err(error.into()),
    };
    match set.iter().find(|(key, _)| !keys.contains(&key.as_str())) {
        Some((key, _)) => {
            bail!("{}: --set {key}: nothing reads that of such a network", checkpoint.path().display())
        }
        None => Ok(()),
    }
}

/// Refuses to replace a file that does not hold these numbers, or these in half precision: another network, or another
/// training of the same one.
fn keep_another(checkpoint: &Checkpoint, output: &Path) -> anyhow::Result<()> {
    if !output.metadata().is_ok_and(|metadata| metadata.len() > 0) {
        return Ok(());
    }
    let is_of_it = |(there, value): (&f32, &f32)| there == value || *there == f16_value(f16_bits(*value));
    let holds = |there: &Checkpoint, name: &String| match (there.tensor(name), checkpoint.tensor(name)) {
        (Ok(there), Ok(values)) => there.iter().zip(&values).all(is_of_it),
        _ => false,
    };
    let what = match Checkpoint::open(output) {
        Ok(there) if there.shapes() == checkpoint.shapes() => {
            match there.shapes().keys().find(|name| !holds(&there, name)) {
                None => return Ok(()),
                Some(name) => format!("has other numbers in '{name}'"),
            }
        }
        _ => "has other tensors".to_owned(),
    };
    Err(foreign(output, &format!("{what} than {}", checkpoint.path().display())))
}

/// Learned attention for firmware: for the C face, or in Rust with 8 bits a weight.
fn for_firmware(arguments: &Arguments, is_rust: bool) -> anyhow::Result<ExitCode> {
    let Arguments { input, output, .. } = arguments;
    check_writable(output)?;
    keep_others(output)?;
    let AttentionModel::Fourier(embedding) = AttentionModel::open(input)? else {
        bail!("{}: firmware supports only attention with the Fourier embedding (paper.0.weight)", input.display());
    };
    let name = input.file_name().unwrap_or(input.as_os_str()).to_string_lossy();
    let (text, what) = match is_rust {
        true => {
            let parameters = quantised(&embedding);
            let bytes = size_of_val(&parameters);
            (
                rust_source(&parameters, &name),
                format!("ATTENTION, {bytes} bytes, for quantised_attention and SourceKeys"),
            )
        }
        false => {
            let what = "viewfuse_attention_parameters for viewfuse_attend_8, _16 and _32";
            (c_header(&embedding, &name), what.to_owned())
        }
    };
    write_whole(output, text.as_bytes())?;
    say(format_args!("written    {}: {what}", output.display()))?;
    Ok(ExitCode::SUCCESS)
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let output = &arguments.output;
    let ends_in = |name: &str| output.extension().is_some_and(|extension| extension == name);
    if (ends_in("h") || ends_in("rs")) && !arguments.half {
        ensure!(arguments.set.is_empty(), "{}: only safetensors say of themselves what --set sets", output.display());
        return for_firmware(arguments, ends_in("rs"));
    }
    ensure!(
        ends_in("safetensors"),
        "{}: output formats are safetensors, and a C header or Rust for learned attention; give a name that ends in \
         .safetensors, or in .h or .rs without --half",
        output.display()
    );
    let is_attention = arguments.half && AttentionModel::open(&arguments.input).is_ok();
    ensure!(
        !is_attention,
        "{}: learned attention is read in f32: convert it without --half",
        arguments.input.display()
    );
    check_writable(output)?;
    let mut checkpoint = Checkpoint::open(&arguments.input)?;
    arguments.set.iter().for_each(|(key, value)| checkpoint.set(key, value));
    check_settings(&checkpoint, &arguments.set)?;
    keep_another(&checkpoint, output)?;
    let progress = Terminal::new("converting");
    pixelnerf::Architecture::assumption(&checkpoint).iter().for_each(|assumption| progress.warn(assumption));
    let of_genvs = genvs::Architecture::of(&checkpoint).ok();
    of_genvs
        .map(|genvs| genvs.assumptions(&checkpoint))
        .iter()
        .flatten()
        .for_each(|assumption| progress.warn(assumption));
    let precision = if arguments.half { Precision::Half } else { Precision::Kept };
    let written = checkpoint.write_safetensors(output, precision, &progress)?;
    drop(progress);
    let mut rows = table(["tensor", "type", "shape", "bytes"].map(str::to_owned));
    for (name, element, shape, bytes) in &written.tensors {
        rows.add_row([name.clone(), element.name().to_owned(), format!("{shape:?}"), bytes.to_string()]);
    }
    say(rows)?;
    for (key, value) in checkpoint.metadata() {
        say(format_args!("kept       {key} = {value}"))?;
    }
    say(format_args!("read       {} ({})", checkpoint.path().display(), checkpoint.origin()))?;
    say(format_args!("written    {}: {} tensors, {} bytes", output.display(), written.tensors.len(), written.bytes))?;
    if arguments.half {
        say(format_args!("rounding   {:.2e} of the value at most", written.relative_error))?;
        if written.tiny_count > 0 {
            say(format_args!(
                "           {} values below 6.1e-5 are changed by {:.1e} at most",
                written.tiny_count, written.tiny_error
            ))?;
        }
    }
    Ok(ExitCode::SUCCESS)
}
