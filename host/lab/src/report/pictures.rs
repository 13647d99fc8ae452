//! Pictures side by side: the sources with their weights, every scheme's prediction, the truth.

use super::{ReportError, counted, data_address};
use image::{DynamicImage, RgbImage};
use maud::{Markup, html};
use std::path::Path;
use viewfuse_evaluate::PSNR;
use viewfuse_evaluate::gallery::{self, SchemePicture, TargetPictures};
use viewfuse_evaluate::summary::Metric;
use viewfuse_output::sheet::error_map;
use viewfuse_scene::{encode_png, read_picture};

/// Width and height of a bar of weights, in units of the figure.
const BAR: [f32; 2] = [8.0, 22.0];

/// What the colours of error maps mean.
pub(super) fn error_legend() -> Markup {
    html! {
        span.scale aria-hidden="true" {}
        " Below each picture its error: white where it is equal to the photograph, through red to black at a mean \
         difference of a quarter of the range, and above."
    }
}

/// A picture of the folder, as pixels.
fn pixels(folder: &Path, file: &str) -> Result<RgbImage, ReportError> {
    Ok(read_picture(&gallery::picture_path(folder, file)?)?.into_rgb8())
}

/// The error map of a picture as a data URL; none if it has another size than the truth.
fn error_address(folder: &Path, file: &str, truth: &RgbImage) -> Result<Option<String>, ReportError> {
    let picture = pixels(folder, file)?;
    if picture.dimensions() != truth.dimensions() {
        return Ok(None);
    }
    let encoded = encode_png(&DynamicImage::ImageRgb8(error_map(&picture, truth)));
    let bytes = encoded.map_err(|cause| ReportError::Figure(cause.to_string()))?;
    Ok(Some(data_address("image/png", &bytes)))
}

/// The pictures of a target.
pub(super) fn comparison(folder: &Path, shown: &TargetPictures) -> Result<Markup, ReportError> {
    let picture =
        |file: &str| -> Result<String, ReportError> { Ok(data_address("image/png", &gallery::picture(folder, file)?)) };
    let sources: Vec<String> = shown.sources.iter().map(|source| picture(&source.file)).collect::<Result<_, _>>()?;
    let predictions: Vec<String> =
        shown.schemes.iter().map(|scheme| picture(&scheme.file)).collect::<Result<_, _>>()?;
    let truth = picture(&shown.truth)?;
    let truth_pixels = pixels(folder, &shown.truth)?;
    let error = |file: &str| error_address(folder, file, &truth_pixels);
    let errors: Vec<Option<String>> =
        shown.schemes.iter().map(|scheme| error(&scheme.file)).collect::<Result<_, _>>()?;
    let copy = match &shown.copy {
        Some(copy) => Some((copy, picture(&copy.file)?, error(&copy.file)?)),
        None => None,
    };
    let heaviest = shown.schemes.iter().flat_map(|scheme| &scheme.weights).copied().fold(0.0, f32::max);
    let metric = Metric::named(PSNR);
    let psnr = |scheme: &SchemePicture| {
        scheme.values.iter().find(|(name, _)| name == PSNR).map(|(_, value)| value.unwrap_or(f64::INFINITY))
    };
    // The best as it is written.
    let copied = shown.copy.as_ref().and_then(|copy| copy.psnr);
    let best = shown.schemes.iter().filter_map(psnr).chain(copied).fold(f64::NEG_INFINITY, f64::max);
    let marked = |value: f64| {
        if metric.text(value) == metric.text(best) {
            html! { b { (metric.text(value)) } }
        } else {
            html! { (metric.text(value)) }
        }
    };
    Ok(html! {
        article.comparison {
            h4 { (shown.scene) ", view " (shown.target) ", from " (counted(shown.sources.len(), "source")) }
            div.sources {
                @for (index, (source, address)) in shown.sources.iter().zip(&sources).enumerate() {
                    figure { img src=(address) alt={ "source " (source.name) }; figcaption { b { (index + 1) } br; (source.name) } }
                }
            }
            div.predictions {
                figure.truth { img src=(truth) alt="the photograph at the target"; figcaption { "truth" } }
                @if let Some((copy, address, error)) = &copy {
                    figure {
                        img src=(address) alt={ "copy of the nearest source, " (copy.source) };
                        @if let Some(error) = error { img.error src=(error) alt="its error"; }
                        figcaption {
                            "nearest copy"
                            @if let Some(psnr) = copy.psnr { br; (marked(psnr)) " dB" }
                        }
                    }
                }
                @for ((scheme, address), error) in shown.schemes.iter().zip(&predictions).zip(&errors) {
                    figure {
                        img src=(address) alt={ "prediction with " (scheme.scheme) };
                        @if let Some(error) = error { img.error src=(error) alt={ "error with " (scheme.scheme) }; }
                        (bars(&scheme.weights, heaviest))
                        figcaption {
                            (breakable(&scheme.scheme))
                            @if let Some(psnr) = psnr(scheme) { br; (marked(psnr)) " dB" }
                        }
                    }
                }
            }
            (weights(shown))
        }
    })
}

/// The name of a scheme, with line breaks allowed between its parts.
fn breakable(name: &str) -> Markup {
    let pieces = name.split_inclusive([',', ':', '/']);
    html! { @for (index, piece) in pieces.enumerate() { @if index > 0 { wbr; } (piece) } }
}

/// The weights of the sources as bars in their order, all schemes on the same scale.
fn bars(weights: &[f32], heaviest: f32) -> Markup {
    let [width, height] = BAR;
    let words: Vec<String> =
        weights.iter().enumerate().map(|(index, weight)| format!("{}: {weight:.3}", index + 1)).collect();
    html! {
        svg.bars viewBox={ "0 0 " (width * weights.len() as f32) " " (height) } preserveAspectRatio="none" role="img" aria-label={ "weights " (words.join(", ")) } {
            title { "weights " (words.join(", ")) }
            @for (index, weight) in weights.iter().enumerate() {
                @let length = height * weight / heaviest.max(f32::MIN_POSITIVE);
                rect x=(width * index as f32 + 0.08 * width) y=(height - length) width=(0.84 * width) height=(length) {}
            }
        }
    }
}

/// The weights as numbers, collapsed.
fn weights(shown: &TargetPictures) -> Markup {
    html! {
        details {
            summary { "Weights" }
            div.scroll {
                table.results {
                    thead { tr {
                        th scope="col" { "weighting" }
                        @for (index, source) in shown.sources.iter().enumerate() { th scope="col" title=(source.name) { (index + 1) } }
                    } }
                    tbody {
                        @for scheme in &shown.schemes {
                            tr {
                                th scope="row" { (scheme.scheme) }
                                @for weight in &scheme.weights {
                                    td { @if *weight > 0.0 { (format!("{weight:.3}")) } @else { "–" } }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}
