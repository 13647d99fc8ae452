//! The environment variables of the command.

use std::env;
use std::ffi::OsString;
use std::path::PathBuf;
use std::time::Duration;
use viewfuse_device::choice::DeviceOptions;
use viewfuse_vulkan::{GpuOptions, InstanceOptions};

/// `VIEWFUSE_VULKAN_LOADER` is the path of another Vulkan loader; `VIEWFUSE_VALIDATION=1` turns on the validation
/// layers, each of whose messages is an error.
pub(crate) fn instance_options() -> InstanceOptions {
    InstanceOptions {
        loader: env::var_os("VIEWFUSE_VULKAN_LOADER").map(PathBuf::from),
        validation: env::var_os("VIEWFUSE_VALIDATION").is_some_and(|value| value == "1"),
    }
}

/// Time between two lines of progress where standard error is no terminal.
const BETWEEN_LINES: Duration = Duration::from_secs(5);

/// The same by `VIEWFUSE_PROGRESS`, in seconds, if it is a number of them; 0 stands for a line at each change.
pub(crate) fn time_between_lines() -> Duration {
    let given = env::var("VIEWFUSE_PROGRESS").ok().and_then(|text| text.parse().ok());
    given.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok()).unwrap_or(BETWEEN_LINES)
}

/// The environment's Vulkan, with these device options.
pub(crate) fn device_options(gpu: GpuOptions) -> DeviceOptions {
    DeviceOptions { instance: instance_options(), gpu, memory: cache_folder(|name| env::var_os(name)) }
}

/// The program that finds poses: `VIEWFUSE_OPENMVG`, or the one that lies beside this command; where neither is, one of
/// this name that the system finds.
pub(crate) fn openmvg() -> PathBuf {
    let name = format!("viewfuse-openmvg{}", env::consts::EXE_SUFFIX);
    let beside = || env::current_exe().ok().map(|program| program.with_file_name(&name)).filter(|path| path.is_file());
    env::var_os("VIEWFUSE_OPENMVG").map(PathBuf::from).or_else(beside).unwrap_or_else(|| name.into())
}

/// The person's own COLMAP: `VIEWFUSE_COLMAP`, or `colmap` that the system finds.
pub(crate) fn colmap() -> PathBuf {
    env::var_os("VIEWFUSE_COLMAP").map_or_else(|| "colmap".into(), PathBuf::from)
}

/// The Python that has the person's own pycolmap: `VIEWFUSE_PYTHON`, or `python3` that the system finds.
pub(crate) fn python() -> PathBuf {
    env::var_os("VIEWFUSE_PYTHON").map_or_else(|| "python3".into(), PathBuf::from)
}

/// Where devices remember what they compiled and measured: `VIEWFUSE_CACHE`, or the folder for such files that the
/// system has for the user. Nowhere if the variable is empty.
fn cache_folder(variable: impl Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    if let Some(folder) = variable("VIEWFUSE_CACHE") {
        return (!folder.is_empty()).then(|| folder.into());
    }
    let folder = |name| variable(name).map(PathBuf::from).filter(|folder: &PathBuf| folder.is_absolute());
    let caches = if cfg!(windows) {
        folder("LOCALAPPDATA")
    } else if cfg!(target_os = "macos") {
        folder("HOME").map(|home| home.join("Library/Caches"))
    } else {
        folder("XDG_CACHE_HOME").or_else(|| folder("HOME").map(|home| home.join(".cache")))
    };
    caches.map(|caches| caches.join("viewfuse"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(set: &[(&str, &str)]) -> Option<PathBuf> {
        cache_folder(|name| set.iter().find(|(of, _)| *of == name).map(|(_, value)| OsString::from(value)))
    }

    #[test]
    fn an_empty_variable_switches_the_cache_off() {
        let system = [("XDG_CACHE_HOME", "/x"), ("HOME", "/h"), ("LOCALAPPDATA", "/l")];
        assert!(folder(&system).is_some_and(|folder| folder.ends_with("viewfuse")));
        assert_eq!(folder(&[&[("VIEWFUSE_CACHE", "mine")], &system[..]].concat()), Some("mine".into()));
        assert_eq!(folder(&[&[("VIEWFUSE_CACHE", "")], &system[..]].concat()), None);
        assert_eq!(folder(&[]), None, "no folder of the person's");
        #[cfg(target_os = "linux")]
        assert_eq!(folder(&[("XDG_CACHE_HOME", "beside"), ("HOME", "/h")]), Some("/h/.cache/viewfuse".into()));
    }
}
