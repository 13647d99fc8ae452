//! Drawing text, lines and small pictures on an RGB image: contact sheets and camera maps.

use embedded_graphics::mono_font::{MonoTextStyle, ascii::FONT_6X10};
use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::prelude::*;
use embedded_graphics::primitives::{Circle, Line, PrimitiveStyle, Rectangle};
use embedded_graphics::text::{Baseline, Text};
use image::{Rgb, RgbImage, imageops};
use std::convert::Infallible;

/// Width of a character of [`Canvas::text`], in pixels.
pub const CHARACTER_WIDTH: u32 = 6;
/// Height of a line of [`Canvas::text`], in pixels.
pub const LINE_HEIGHT: u32 = 12;

/// A colour, red green blue.
pub type Colour = [u8; 3];

/// Near black on white, for text.
pub const INK: Colour = [30, 30, 34];
/// Page background.
pub const PAPER: Colour = [255, 255, 255];
/// Muted grey for frames and secondary lines.
pub const GREY: Colour = [170, 170, 176];
/// The colour of sources.
pub const BLUE: Colour = [40, 98, 180];
/// The colour of targets.
pub const RED: Colour = [200, 62, 48];

/// An RGB image to draw on. Everything is clipped to its borders.
pub struct Canvas {
    pixels: RgbImage,
}

impl Canvas {
    /// A blank page.
    pub fn new(width: u32, height: u32) -> Canvas {
        Canvas { pixels: RgbImage::from_pixel(width.max(1), height.max(1), Rgb(PAPER)) }
    }

    /// The drawn picture.
    pub fn into_image(self) -> RgbImage {
        self.pixels
    }

    /// One line of ASCII text with its top left corner at `(x, y)`.
    pub fn text(&mut self, x: i32, y: i32, text: &str, colour: Colour) {
        let style = MonoTextStyle::new(&FONT_6X10, to_rgb(colour));
        let Ok(_) = Text::with_baseline(text, Point::new(x, y), style, Baseline::Top).draw(self);
    }

    /// A line one pixel wide.
    pub fn line(&mut self, from: (i32, i32), to: (i32, i32), colour: Colour) {
        let style = PrimitiveStyle::with_stroke(to_rgb(colour), 1);
        let Ok(()) = Line::new(from.into(), to.into()).into_styled(style).draw(self);
    }

    /// A disc around a centre.
    pub fn disc(&mut self, centre: (i32, i32), diameter: u32, colour: Colour) {
        let style = PrimitiveStyle::with_fill(to_rgb(colour));
        let Ok(()) = Circle::with_center(centre.into(), diameter).into_styled(style).draw(self);
    }

    /// A filled rectangle.
    pub fn fill(&mut self, x: i32, y: i32, width: u32, height: u32, colour: Colour) {
        let style = PrimitiveStyle::with_fill(to_rgb(colour));
        let Ok(()) = Rectangle::new(Point::new(x, y), Size::new(width, height)).into_styled(style).draw(self);
    }

    /// A rectangle's outline.
    pub fn frame(&mut self, x: i32, y: i32, width: u32, height: u32, colour: Colour) {
        let style = PrimitiveStyle::with_stroke(to_rgb(colour), 1);
        let Ok(()) = Rectangle::new(Point::new(x, y), Size::new(width, height)).into_styled(style).draw(self);
    }

    /// A picture with its top left corner at `(x, y)`.
    pub fn picture(&mut self, x: i32, y: i32, picture: &RgbImage) {
        imageops::replace(&mut self.pixels, picture, i64::from(x), i64::from(y));
    }
}

fn to_rgb(colour: Colour) -> Rgb888 {
    Rgb888::new(colour[0], colour[1], colour[2])
}

impl OriginDimensions for Canvas {
    fn size(&self) -> Size {
        Size::new(self.pixels.width(), self.pixels.height())
    }
}

impl DrawTarget for Canvas {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(&mut self, pixels: I) -> Result<(), Infallible> {
        for Pixel(at, colour) in pixels {
            if let (Ok(x), Ok(y)) = (u32::try_from(at.x), u32::try_from(at.y))
                && let Some(pixel) = self.pixels.get_pixel_mut_checked(x, y)
            {
                *pixel = Rgb([colour.r(), colour.g(), colour.b()]);
            }
        }
        Ok(())
    }
}
