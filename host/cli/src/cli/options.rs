//! Options that several commands share.

use super::environment::device_options;
use super::parse::{parse_count, parse_error, parse_seconds, parse_share, parse_size};
use super::wrong::wrong;
use clap::parser::ValueSource;
use clap::{ArgMatches, Args, Command};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;
use viewfuse_device::choice::{self, Chosen, DeviceChoice};
use viewfuse_field::About;
use viewfuse_field::budget::Bound;
use viewfuse_field::render::{DEFAULT_EARLY_TERMINATION, DEFAULT_LEAVE_OUT, RenderOptions};
use viewfuse_field::rows;
use viewfuse_scene::few_shot::{PathChoice, Selection};
use viewfuse_scene::photographs::BackgroundChoice;
use viewfuse_scene::{MaskChoice, Scene, SceneError};
use viewfuse_vulkan::{GpuOptions, VulkanError};

/// Heading of the options that say what is omitted.
pub(crate) const EFFORTS: &str = "Efforts: what is omitted, for which time and error";

/// How a scene is opened, for every command that reads its photographs.
#[derive(Args)]
pub(crate) struct MaskOption {
    /// What masks and alpha channels say: object (where it is), ignore (which pixels do not count), none (they are not
    /// used), or auto: what their layout and the masks themselves show
    #[arg(long, value_name = "MEANING", default_value = "auto")]
    masks: MaskChoice,
}

impl MaskOption {
    /// Opens a scene.
    pub(crate) fn open(&self, scene: impl AsRef<Path>) -> Result<Scene, SceneError> {
        Scene::open_masked(scene, self.masks)
    }
}

/// Options of pictures.
#[derive(Args)]
pub(crate) struct PictureOptions {
    /// Size of the pictures; without --model the sources are resampled to the same scale [default: the views' size, at
    /// most 512, of a GeNVS at most the size that it was trained for]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    size: Option<[u32; 2]>,
    /// Background of the object: auto, black, white, or RED,GREEN,BLUE (0 to 255)
    #[arg(long, value_name = "COLOUR", default_value = "auto")]
    background: BackgroundChoice,
    #[command(flatten)]
    pub(crate) masks: MaskOption,
    /// Work on this many threads [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub(crate) threads: Option<u16>,
}

impl PictureOptions {
    pub(crate) fn to_render_options(&self) -> RenderOptions {
        RenderOptions { size: self.size, background: self.background, ..RenderOptions::default() }
    }
}

/// What any field may omit.
#[derive(Args)]
pub(crate) struct OmissionOptions {
    /// Leave out the least relevant sources while their weights together stay at or below this; without a network
    /// pictures of whole photographs are made from the nine most relevant at most, unless this is 0
    #[arg(long, value_name = "TOTAL", default_value_t = DEFAULT_LEAVE_OUT, value_parser = parse_share,
        help_heading = EFFORTS)]
    leave_out: f32,
    /// Early termination: leave out samples behind the point where a ray's transmittance falls below this; not with a
    /// GeNVS [default: 1/256]
    #[arg(long, value_name = "SHARE", value_parser = parse_share, help_heading = EFFORTS)]
    early_termination: Option<f32>,
}

impl OmissionOptions {
    /// The options with these omissions; with `exact`, nothing is omitted. Options that the field does not have are
    /// rejected.
    pub(crate) fn omitting(&self, options: RenderOptions, exact: bool, field: &About) -> anyhow::Result<RenderOptions> {
        if self.early_termination.is_some() && !field.ends_rays {
            let title = rows::named(field.name).map_or(field.name, |row| row.title);
            return Err(wrong(format_args!(
                "--early-termination cannot be used with a {title}, which has no early termination"
            )));
        }
        let early_termination =
            if exact || !field.ends_rays { 0.0 } else { self.early_termination.unwrap_or(DEFAULT_EARLY_TERMINATION) };
        let leave_out = if exact { 0.0 } else { self.leave_out };
        Ok(RenderOptions { leave_out, early_termination, ..options })
    }
}

/// Options that a bound replaces, beside efforts of the fields' rows: it chooses what is omitted.
const CHOSEN_BY_A_BOUND: [&str; 2] = ["exact", "compute"];

/// A bound on the error or the time of each picture.
#[derive(Args)]
pub(crate) struct BoundOptions {
    /// Choose the effort: leave out what the pictures do not need for this root mean square difference from the exact
    /// ones, in decibels (40dB) or with colours from 0 to 1 (0.01) [default with a network: 45dB, unless options say
    /// what is omitted]
    #[arg(long, value_name = "ERROR", value_parser = parse_error, allow_hyphen_values = true,
        conflicts_with_all = CHOSEN_BY_A_BOUND, help_heading = EFFORTS)]
    max_error: Option<f32>,
    /// Choose the effort: leave out what does not fit into this time for each picture: seconds, or milliseconds as
    /// 250ms
    #[arg(long, value_name = "TIME", value_parser = parse_seconds, allow_hyphen_values = true,
        conflicts_with_all = CHOSEN_BY_A_BOUND, conflicts_with = "max_error", help_heading = EFFORTS)]
    max_time: Option<Duration>,
}

impl BoundOptions {
    /// The options with this bound; where none is given and no further option says what is omitted, with that of the
    /// field's row.
    pub(crate) fn bounded(&self, options: RenderOptions, field: &About, says_omissions: bool) -> RenderOptions {
        let bound = self.max_error.map(Bound::Error).or(self.max_time.map(Bound::Time));
        let options = RenderOptions { bound, ..options };
        match rows::named(field.name) {
            Some(row) if !says_omissions => row.bounded(options),
            _ => options,
        }
    }
}

/// Options of the device.
#[derive(Args)]
pub(crate) struct DeviceOptions {
    /// Device: auto (a GPU if there is one, otherwise the CPU), cpu, vulkan, vulkan:NUMBER or vulkan:NAME
    #[arg(long, value_name = "DEVICE", default_value = "auto")]
    device: DeviceChoice,
    /// Time limit of a submission to a Vulkan device [default: 120 on a GPU, none on a software driver]
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds)]
    time_limit: Option<Duration>,
}

impl DeviceOptions {
    pub(crate) fn open(&self) -> Result<Chosen, VulkanError> {
        choice::open(&self.device, &device_options(GpuOptions { time_limit: self.time_limit, ..GpuOptions::default() }))
    }
}

/// The choice of source views.
#[derive(Args)]
pub(crate) struct SourceOptions {
    /// Source views: names or indices (`inspect --views` lists them; '#3' is the index 3), ranges A..B with both
    /// ends included, `all`, each with /STEP, separated by commas [default: all but the targets; in
    /// evaluate all but the target that is rendered]
    #[arg(long, value_name = "VIEWS")]
    sources: Option<String>,
    /// Use at most this many sources, as far apart as possible
    #[arg(long, value_name = "K", value_parser = parse_count)]
    views: Option<usize>,
}

impl SourceOptions {
    pub(crate) fn to_selection(&self, targets: Option<&str>, path: Option<PathChoice>) -> Selection {
        let (targets, sources) = (targets.map(str::to_owned), self.sources.clone());
        Selection { targets, path, sources, view_count: self.views, may_share: false }
    }
}

/// Every option of the command that was given, by its long name, with its values as on the command line, defaults
/// included.
pub(crate) fn values(command: &Command, matches: &ArgMatches) -> BTreeMap<String, String> {
    let Some((name, matches)) = matches.subcommand() else { return BTreeMap::new() };
    let arguments = command.find_subcommand(name).into_iter().flat_map(Command::get_arguments);
    let value = |argument: &clap::Arg| {
        let values = matches.try_get_raw(argument.get_id().as_str()).ok()??;
        let texts: Vec<String> = values.map(|value| value.to_string_lossy().into_owned()).collect();
        Some((argument.get_long()?.to_owned(), texts.join(" ")))
    };
    arguments.filter_map(value).collect()
}

/// The options of the command that were written on the command line, by long name, each with its value if it takes one.
pub(crate) fn given(command: &Command, matches: &ArgMatches) -> Vec<(String, Option<String>)> {
    let Some((name, matches)) = matches.subcommand() else { return Vec::new() };
    let arguments = command.find_subcommand(name).into_iter().flat_map(Command::get_arguments);
    let value = |argument: &clap::Arg| {
        let id = argument.get_id().as_str();
        let name = argument.get_long()?.to_owned();
        if matches.value_source(id)? != ValueSource::CommandLine {
            return None;
        }
        let values = matches.try_get_raw(id).ok()??;
        let texts: Vec<String> = values.map(|value| value.to_string_lossy().into_owned()).collect();
        Some((name, argument.get_action().takes_values().then(|| texts.join(","))))
    };
    arguments.filter_map(value).collect()
}
