//! `viewfuse convert`.

use super::say;
use super::table::table;
use super::terminal::Terminal;
use anyhow::{bail, ensure};
use clap::Args;
use std::path::PathBuf;
use std::process::ExitCode;
use viewfuse_job::files::{check_writable, write_whole};
use viewfuse_nn::checkpoint::{Checkpoint, Precision};
use viewfuse_weighting::attention::{AttentionModel, c_header};

#[derive(Args)]
#[command(after_help = "Examples:\n  viewfuse convert pixel_nerf_latest pixelnerf.safetensors --half\n  \
    viewfuse convert weighting.safetensors attention.h\n      learned attention, for firmware that links the C face\n\n\
    Read are safetensors, what torch.save writes, new and old, and networks that Python's pickle wrote (.pkl), such as \
    snapshots of EDM's training. Nothing in a file is executed.")]
pub(crate) struct Arguments {
    /// The checkpoint
    input: PathBuf,
    /// Where to write it, as safetensors; learned attention with the Fourier embedding also as a C header
    #[arg(value_name = "OUT.safetensors|OUT.h")]
    output: PathBuf,
    /// Round floating point numbers to 16 bits
    #[arg(long)]
    half: bool,
}

/// Learned attention for the C face.
fn header(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let Arguments { input, output, .. } = arguments;
    check_writable(output)?;
    let AttentionModel::Fourier(embedding) = AttentionModel::open(input)? else {
        bail!("{}: the C face knows only attention with the Fourier embedding (paper.0.weight)", input.display());
    };
    let name = input.file_name().unwrap_or(input.as_os_str()).to_string_lossy();
    write_whole(output, c_header(&embedding, &name).as_bytes())?;
    say(format_args!(
        "written    {}: viewfuse_attention_parameters for viewfuse_attend_8, _16 and _32",
        output.display()
    ))?;
    Ok(ExitCode::SUCCESS)
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let output = &arguments.output;
    let ends_in = |wanted: &str| output.extension().is_some_and(|extension| extension == wanted);
    if ends_in("h") && !arguments.half {
        return header(arguments);
    }
    ensure!(
        ends_in("safetensors"),
        "{}: only safetensors are written, and learned attention as a C header; give a name that ends in .safetensors, \
         or in .h without --half",
        output.display()
    );
    check_writable(output)?;
    let checkpoint = Checkpoint::open(&arguments.input)?;
    let precision = if arguments.half { Precision::Half } else { Precision::Kept };
    let written = checkpoint.write_safetensors(output, precision, &Terminal::new("converting"))?;
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
