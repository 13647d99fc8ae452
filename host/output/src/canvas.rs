//! Drawing text, lines and small pictures on an RGB image: contact sheets and camera maps.

use image::{Rgb, RgbImage, imageops};

/// Width of a character of [`Canvas::text`], in pixels.
pub const CHARACTER_WIDTH: u32 = 6;
/// The printable characters of ASCII in rows of 16, one bit a pixel: the public-domain font "6x10" of the X Window
/// System. A crate of fonts brings five others for this one.
const FONT: &[u8; 720] = include_bytes!("canvas/font_6x10.raw");
/// Rows of pixels of a character.
const CHARACTER_HEIGHT: u32 = 10;
/// Characters in a row of [`FONT`].
const CHARACTERS: u32 = 16;

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

    /// One line of text with its top left corner at `(x, y)`; what is not ASCII is a question mark.
    pub fn text(&mut self, x: i32, y: i32, text: &str, colour: Colour) {
        for (place, character) in (0..).zip(text.chars()) {
            let shown = if (' '..='~').contains(&character) { character } else { '?' };
            let (index, left) = (u32::from(shown) - u32::from(' '), x + place * CHARACTER_WIDTH as i32);
            for row in 0..CHARACTER_HEIGHT {
                for column in 0..CHARACTER_WIDTH {
                    let across = index % CHARACTERS * CHARACTER_WIDTH + column;
                    let down = index / CHARACTERS * CHARACTER_HEIGHT + row;
                    let byte = FONT[(down * CHARACTERS * CHARACTER_WIDTH / 8 + across / 8) as usize];
                    if byte >> (7 - across % 8) & 1 == 1 {
                        self.pixel(left + column as i32, y + row as i32, colour);
                    }
                }
            }
        }
    }

    /// A line one pixel wide, both ends included (Bresenham's).
    pub fn line(&mut self, from: (i32, i32), to: (i32, i32), colour: Colour) {
        let (dx, dy) = ((to.0 - from.0).abs(), (to.1 - from.1).abs());
        let (step_x, step_y) = (if to.0 >= from.0 { 1 } else { -1 }, if to.1 >= from.1 { 1 } else { -1 });
        // One step along the longer side for each pixel, one along the other where the error is too large.
        let (long, short, along, aside) =
            if dy >= dx { (dy, dx, (0, step_y), (step_x, 0)) } else { (dx, dy, (step_x, 0), (0, step_y)) };
        let ((mut x, mut y), mut error) = (from, 0);
        for _ in 0..=long {
            if error > long {
                (x, y, error) = (x + aside.0, y + aside.1, error - 2 * long);
            }
            self.pixel(x, y, colour);
            (x, y, error) = (x + along.0, y + along.1, error + 2 * short);
        }
    }

    /// A disc around a centre, of an odd diameter.
    pub fn disc(&mut self, centre: (i32, i32), diameter: u32, colour: Colour) {
        let (diameter, radius) = (diameter as i32, diameter as i32 / 2);
        for (dy, dx) in (-radius..=radius).flat_map(|dy| (-radius..=radius).map(move |dx| (dy, dx))) {
            if 4 * (dx * dx + dy * dy) < diameter * diameter {
                self.pixel(centre.0 + dx, centre.1 + dy, colour);
            }
        }
    }

    /// A filled rectangle.
    pub fn fill(&mut self, x: i32, y: i32, width: u32, height: u32, colour: Colour) {
        for (row, column) in (0..height as i32).flat_map(|row| (0..width as i32).map(move |column| (row, column))) {
            self.pixel(x + column, y + row, colour);
        }
    }

    /// A rectangle's outline, inside of it.
    pub fn frame(&mut self, x: i32, y: i32, width: u32, height: u32, colour: Colour) {
        self.fill(x, y, width, 1, colour);
        self.fill(x, y + height as i32 - 1, width, 1, colour);
        self.fill(x, y, 1, height, colour);
        self.fill(x + width as i32 - 1, y, 1, height, colour);
    }

    fn pixel(&mut self, x: i32, y: i32, colour: Colour) {
        if let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y))
            && let Some(pixel) = self.pixels.get_pixel_mut_checked(x, y)
        {
            *pixel = Rgb(colour);
        }
    }

    /// A picture with its top left corner at `(x, y)`.
    pub fn picture(&mut self, x: i32, y: i32, picture: &RgbImage) {
        imageops::replace(&mut self.pixels, picture, i64::from(x), i64::from(y));
    }
}
