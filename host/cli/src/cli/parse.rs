//! Values of options that several commands have.

use std::time::Duration;

/// Memory for each pixel of a picture while it is rendered: colours, depths and confidences as 32-bit numbers, the
/// picture and what is written of it. Measured with a network, 45 bytes.
const PIXEL_BYTES: u64 = 48;

/// Most memory for a picture.
const MAX_PICTURE_BYTES: u64 = 4 << 30;

/// Width and height of pictures.
///
/// # Errors
/// In words, what a size is.
pub fn parse_size(text: &str) -> Result<[u32; 2], String> {
    let sides = text.split_once(['x', 'X']).and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    match sides {
        Some([width, height]) if (1..=16_384).contains(&width) && (1..=16_384).contains(&height) => {
            let bytes = PIXEL_BYTES * u64::from(width) * u64::from(height);
            let [needed, most] = [bytes, MAX_PICTURE_BYTES].map(|bytes| bytes >> 20);
            if bytes <= MAX_PICTURE_BYTES {
                Ok([width, height])
            } else {
                Err(format!(
                    "a picture of this size takes about {needed} MiB while it is rendered; at most {most} MiB are used"
                ))
            }
        }
        _ => Err("a size is WIDTHxHEIGHT, for example 160x120, each from 1 to 16384".to_owned()),
    }
}

/// A share of something.
pub(super) fn parse_share(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(share) if (0.0..1.0).contains(&share) => Ok(share),
        _ => Err("a share is a number of at least 0 and less than 1".to_owned()),
    }
}

/// A time.
pub(super) fn parse_seconds(text: &str) -> Result<Duration, String> {
    let (number, unit) = match (text.strip_suffix("ms"), text.strip_suffix('s')) {
        (Some(number), _) => (number, 1.0e-3),
        (None, Some(number)) => (number, 1.0),
        (None, None) => (text, 1.0),
    };
    match number.trim().parse::<f64>().map(|number| unit * number) {
        Ok(seconds) if (0.001..=86_400.0).contains(&seconds) => Ok(Duration::from_secs_f64(seconds)),
        _ => Err("a number of seconds from 0.001 to 86400, or milliseconds as 250ms".to_owned()),
    }
}

/// A root mean square difference of colours from 0 to 1: a number, or decibels below 1.
pub(super) fn parse_error(text: &str) -> Result<f32, String> {
    let lower = text.to_ascii_lowercase();
    let value = match lower.strip_suffix("db") {
        Some(decibels) => decibels.trim().parse::<f64>().ok().map(|decibels| 10.0_f64.powf(-decibels / 20.0)),
        None => lower.parse::<f64>().ok(),
    };
    match value {
        Some(error) if (1.0e-6..=0.5).contains(&error) => Ok(error as f32),
        _ => Err("a root mean square difference from 0.000001 to 0.5, or decibels from 6.1dB to 120dB".to_owned()),
    }
}

/// How many.
pub(super) fn parse_count(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(count) if (1..=10_000).contains(&count) => Ok(count),
        _ => Err("a whole number from 1 to 10000".to_owned()),
    }
}
