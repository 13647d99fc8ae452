//! The C interface: every function with any numbers, in arrays that begin or end at a page that nobody may touch.
//!
//! A function may read and write what its documentation says and nothing else: what fails writes nothing, what succeeds
//! writes its output only, and weights are weights.
#![expect(unsafe_code, reason = "the C interface is called")]

use super::guarded::Guarded;
use super::{Target, Verdict};
use std::ffi::CStr;
use viewfuse_capi_linked::fuse::viewfuse_fuse_views;
use viewfuse_capi_linked::ray::{self, Pixel, Ray};
use viewfuse_capi_linked::schedule::{self, Preconditioning, Step};
use viewfuse_capi_linked::status::{Status, viewfuse_status_text};
use viewfuse_capi_linked::weigh::{self, ATTENTION_PARAMETERS, Scheme};

/// Most arrays of a call, and most words of one of them: the poses of 32 sources, latents.
const ARRAYS: usize = 4;
const WORDS: usize = 1024;

/// The numbers of an input, one behind the other; 0 behind the last.
struct Numbers<'a>(&'a [u8]);

impl Numbers<'_> {
    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        let mut bytes = [0; N];
        let count = N.min(self.0.len());
        bytes[..count].copy_from_slice(&self.0[..count]);
        self.0 = &self.0[count..];
        bytes
    }

    fn byte(&mut self) -> u8 {
        self.bytes::<1>()[0]
    }

    /// Mostly a small number, sometimes any bits.
    fn number(&mut self) -> f32 {
        match self.byte() {
            0..=223 => f32::from(i16::from_le_bytes(self.bytes())) / 1024.0,
            _ => f32::from_le_bytes(self.bytes()),
        }
    }

    fn numbers(&mut self, count: usize) -> Vec<u32> {
        (0..count).map(|_| self.number().to_bits()).collect()
    }

    /// Poses, turned around the z axis; one entry of one of them may be anything.
    fn poses(&mut self, count: usize) -> Vec<u32> {
        let mut entries = Vec::with_capacity(16 * count);
        for _ in 0..count {
            let (sin, cos) = (self.number() % 7.0).sin_cos();
            let [x, y, z] = [self.number(), self.number(), self.number()];
            entries
                .extend([cos, -sin, 0.0, x, sin, cos, 0.0, y, 0.0, 0.0, 1.0, z, 0.0, 0.0, 0.0, 1.0].map(f32::to_bits));
        }
        let (place, number) = (usize::from(u16::from_le_bytes(self.bytes())), self.number());
        // Most of the time it names no entry.
        if let Some(entry) = entries.get_mut(place) {
            *entry = number.to_bits();
        }
        entries
    }
}

/// A call of a function with its arrays given.
type Run = Box<dyn Fn(&[*mut u32]) -> Status>;

/// A call: its arrays, which of them it writes, and itself, given where they are.
struct Call {
    arrays: Vec<Vec<u32>>,
    written: usize,
    /// Whether the output is weights.
    weighs: bool,
    run: Run,
}

/// Every function.
pub(crate) struct Face {
    areas: [Guarded; ARRAYS],
    parameters: Guarded,
    /// What they are before an input changes one of them.
    original: Vec<u32>,
}

impl Face {
    pub(crate) fn new() -> Face {
        let number = |index: u32| (index.wrapping_mul(0x9e37_79b1) >> 8) as f32 * (2.0 / 16_777_216.0) - 1.0;
        let original: Vec<u32> = (0..ATTENTION_PARAMETERS).map(|index| (0.1 * number(index)).to_bits()).collect();
        Face { areas: std::array::from_fn(|_| Guarded::new(WORDS)), parameters: Guarded::new(original.len()), original }
    }
}

/// A call of a function that takes a count and arrays of so many numbers behind a struct of `head` words; the last is
/// written.
fn each(
    numbers: &mut Numbers<'_>,
    head: usize,
    inputs: usize,
    run: impl Fn(&[*mut u32], u32) -> Status + 'static,
) -> Call {
    let count = usize::from(numbers.byte() % 40);
    let mut arrays = vec![numbers.numbers(head)];
    (0..inputs).for_each(|_| arrays.push(numbers.numbers(count)));
    arrays.push(vec![7; count]);
    Call { arrays, written: inputs + 1, weighs: false, run: Box::new(move |at| run(at, count as u32)) }
}

/// A call that weighs, for at most `most` sources.
fn weighing(
    numbers: &mut Numbers<'_>,
    most: usize,
    scheme: Option<Vec<u32>>,
    run: impl Fn(&[*mut u32], u32) -> Status + 'static,
) -> Call {
    // Up to the most, one more, and any: what is too many is not looked at.
    let count = match numbers.byte() {
        255 => u32::from_le_bytes(numbers.bytes()),
        byte => u32::from(byte) % (most as u32 + 2),
    };
    let there = if count as usize <= most { count as usize } else { 0 };
    let mut arrays: Vec<Vec<u32>> = scheme.into_iter().collect();
    arrays.extend([numbers.poses(there), numbers.poses(1), vec![7; there]]);
    Call { written: arrays.len() - 1, arrays, weighs: true, run: Box::new(move |at| run(at, count)) }
}

fn weigh(numbers: &mut Numbers<'_>, most: usize) -> Call {
    let scheme = vec![u32::from(numbers.byte() % 9), u32::from(numbers.byte() % 5), numbers.number().to_bits()];
    weighing(numbers, most, Some(scheme), move |at, count| {
        let function = match most {
            8 => weigh::viewfuse_weigh_8,
            16 => weigh::viewfuse_weigh_16,
            _ => weigh::viewfuse_weigh_32,
        };
        // SAFETY: the arrays have the shapes that the function asks for; a pointer that is wrong is null or not
        // aligned.
        unsafe { function(at[0].cast::<Scheme>(), at[1].cast(), count, at[2].cast(), at[3].cast()) }
    })
}

fn attend(numbers: &mut Numbers<'_>, parameters: &mut Guarded) -> Call {
    let most = [8, 8, 8, 16, 32][usize::from(numbers.byte() % 5)];
    let (place, number) = (usize::from(u16::from_le_bytes(numbers.bytes())), numbers.number());
    if let Some(parameter) = parameters.array().get_mut(place) {
        *parameter = number.to_bits();
    }
    let parameters = parameters.pointer();
    weighing(numbers, most, None, move |at, count| {
        let function = match most {
            8 => weigh::viewfuse_attend_8,
            16 => weigh::viewfuse_attend_16,
            _ => weigh::viewfuse_attend_32,
        };
        // SAFETY: as above; the parameters are as many as the function asks for.
        unsafe { function(parameters.cast(), at[0].cast(), count, at[1].cast(), at[2].cast()) }
    })
}

fn fuse(numbers: &mut Numbers<'_>) -> Call {
    let is_huge = numbers.byte() == 255;
    let [views, channels] = [numbers.byte() % 33, numbers.byte() % 31].map(usize::from);
    let arrays = vec![numbers.numbers(views), numbers.numbers(views * channels), vec![7; channels]];
    let counts = if is_huge { [u32::MAX; 2] } else { [views, channels].map(|count| count as u32) };
    let run = move |at: &[*mut u32]| {
        let [views, channels] = counts;
        // SAFETY: as above; counts whose bytes nobody can count are refused before anything is read.
        unsafe { viewfuse_fuse_views(at[0].cast(), at[1].cast(), views, channels, at[2].cast()) }
    };
    Call { arrays, written: 2, weighs: false, run: Box::new(run) }
}

fn of_ray(numbers: &mut Numbers<'_>) -> Call {
    let (which, [a, b]) = (numbers.byte() % 4, [numbers.number(), numbers.number()]);
    let (ray, rgb) = (numbers.numbers(6), numbers.numbers(3));
    let arrays = if which == 3 { vec![ray, rgb, vec![7; 5]] } else { vec![ray, rgb] };
    let run = move |at: &[*mut u32]| {
        let ray = at[0].cast::<Ray>();
        // SAFETY: as above; the structs consist of so many words.
        unsafe {
            match which {
                0 => ray::viewfuse_ray_start(ray),
                1 => ray::viewfuse_ray_add(ray, at[1].cast(), a, b),
                2 => ray::viewfuse_ray_add_solid(ray, at[1].cast(), a, b),
                _ => ray::viewfuse_ray_finish(ray, at[1].cast(), a, at[2].cast::<Pixel>()),
            }
        }
    };
    Call { arrays, written: if which == 3 { 2 } else { 0 }, weighs: false, run: Box::new(run) }
}

fn of_schedule(numbers: &mut Numbers<'_>) -> Call {
    let (which, [a, b]) = (numbers.byte() % 3, [numbers.number(), numbers.number()]);
    let [index, count] =
        [numbers.byte(), numbers.byte()].map(|byte| if byte == 255 { u32::MAX } else { u32::from(byte) });
    let run = move |at: &[*mut u32]| {
        // SAFETY: as above.
        unsafe {
            match which {
                0 => schedule::viewfuse_noise_level(a, b, index, count, at[0].cast()),
                1 => schedule::viewfuse_preconditioning_at(a, at[0].cast::<Preconditioning>()),
                _ => schedule::viewfuse_step_between(a, b, at[0].cast::<Step>()),
            }
        }
    };
    let length = [1, 4, 2][usize::from(which)];
    Call { arrays: vec![vec![7; length]], written: 0, weighs: false, run: Box::new(run) }
}

fn of_pictures(numbers: &mut Numbers<'_>) -> Call {
    match numbers.byte() % 4 {
        0 => each(numbers, 4, 1, |at, count| {
            // SAFETY: as above.
            unsafe { schedule::viewfuse_network_input(at[0].cast(), at[1].cast(), count, at[2].cast()) }
        }),
        1 => each(numbers, 4, 2, |at, count| {
            // SAFETY: as above.
            unsafe { schedule::viewfuse_denoised(at[0].cast(), at[1].cast(), at[2].cast(), count, at[3].cast()) }
        }),
        2 => each(numbers, 2, 2, |at, count| {
            // SAFETY: as above.
            unsafe { schedule::viewfuse_step_euler(at[0].cast(), at[1].cast(), at[2].cast(), count, at[3].cast()) }
        }),
        // Its output lies over the last input.
        _ => {
            let mut call = each(numbers, 2, 3, |at, count| {
                let [step, stepped, denoised, there] = [at[0], at[1], at[2], at[3]];
                // SAFETY: as above.
                unsafe {
                    schedule::viewfuse_step_correct(
                        step.cast(),
                        stepped.cast(),
                        denoised.cast(),
                        there.cast(),
                        count,
                        there.cast(),
                    )
                }
            });
            call.arrays.pop();
            call.written = 3;
            call
        }
    }
}

/// The text of a status; every number has one.
fn text(status: i32) -> String {
    // SAFETY: a text that the library has in its constants.
    let text = unsafe { CStr::from_ptr(viewfuse_status_text(status)) };
    text.to_str().expect("the text of a status").to_owned()
}

/// Whether numbers are weights.
fn are_weights(words: &[u32]) -> bool {
    let weights: Vec<f32> = words.iter().map(|word| f32::from_bits(*word)).collect();
    weights.iter().all(|weight| *weight >= 0.0) && (weights.iter().sum::<f32>() - 1.0).abs() < 1.0e-5
}

impl Target for Face {
    fn seeds(&self) -> Vec<Vec<u8>> {
        let filled = |kind: u8, seed: usize| {
            let bytes = (0..420_usize).map(|index| (index * (37 + 2 * seed) + seed) as u8 % 200);
            [kind, 0, 0].into_iter().chain(bytes).collect()
        };
        (0..16).flat_map(|kind| (0..3).map(move |seed| filled(kind, seed))).collect()
    }

    fn run(&mut self, bytes: &[u8]) -> Result<Verdict, String> {
        let mut numbers = Numbers(bytes);
        let [kind, places, fault] = numbers.bytes();
        let Face { areas, parameters, original } = self;
        let call = match kind % 16 {
            0..=2 => weigh(&mut numbers, 8),
            3 => weigh(&mut numbers, 16),
            4 => weigh(&mut numbers, 32),
            5..=8 => fuse(&mut numbers),
            9..=10 => of_ray(&mut numbers),
            11..=12 => of_schedule(&mut numbers),
            // A call of learned attention takes as long as a hundred others.
            13 if numbers.byte().is_multiple_of(32) => {
                parameters.lay(original, false);
                attend(&mut numbers, parameters)
            }
            _ => of_pictures(&mut numbers),
        };
        let mut pointers = [std::ptr::null_mut(); ARRAYS];
        for (index, array) in call.arrays.iter().enumerate() {
            areas[index].lay(array, places >> index & 1 == 1);
            pointers[index] = areas[index].pointer();
        }
        // One of 64: a pointer that is null, or not aligned.
        let wrong = usize::from(fault & 3);
        let is_wrong = fault > 251 && wrong < call.arrays.len();
        if is_wrong {
            pointers[wrong] = if places > 127 { std::ptr::null_mut() } else { pointers[wrong].wrapping_byte_add(1) };
        }
        let status = (call.run)(&pointers[..call.arrays.len()]);
        for (index, array) in call.arrays.iter().enumerate() {
            let may_differ = status == Status::Ok && index == call.written;
            let area = &mut areas[index];
            if !(area.is_empty_beside() && (may_differ || area.array() == array.as_slice())) {
                return Err(format!("{status:?}: array {index} of function {} was written", kind % 16));
            }
        }
        if status == Status::Ok && call.weighs && !are_weights(areas[call.written].array()) {
            return Err(format!("no weights: {:?}", areas[call.written].array()));
        }
        let said = text(status as i32);
        if is_wrong && status == Status::Ok && kind % 16 < 9 {
            return Err("a wrong pointer was not refused".to_owned());
        }
        match status {
            Status::Ok => Ok(Verdict::Read),
            _ => Ok(Verdict::Refused(said)),
        }
    }
}
