//! Part of the copy of viewfuse-core: a value as it is, or changed by a hundredth at the one place that is asked for.
#![allow(missing_docs)]

extern crate std;

use core::sync::atomic::{AtomicBool, Ordering};
use std::format;
use std::io::Write;
use std::sync::OnceLock;

const PLACES: usize = PLACE_COUNT;
/// The number that asks for a list of the places that a process reaches.
const LIST: u32 = u32::MAX;

fn asked() -> u32 {
    static ASKED: OnceLock<u32> = OnceLock::new();
    let number = || std::env::var("VIEWFUSE_MUTANT").ok().and_then(|number| number.parse().ok());
    *ASKED.get_or_init(|| number().unwrap_or(u32::MAX - 1))
}

fn list(place: u32) {
    static REACHED: [AtomicBool; PLACES] = [const { AtomicBool::new(false) }; PLACES];
    if !REACHED[place as usize].swap(true, Ordering::Relaxed) {
        let path = std::env::var_os("VIEWFUSE_MUTANT_LIST").expect("a file for the list");
        let file = std::fs::OpenOptions::new().create(true).append(true).open(path);
        // A line at once: other threads write, too.
        file.expect("the list").write_all(format!("{place}\n").as_bytes()).expect("a line");
    }
}

#[inline(always)]
pub fn near<T: Near>(place: u32, value: T) -> T {
    match asked() {
        asked if asked == place => value.near(),
        LIST => {
            list(place);
            value
        }
        _ => value,
    }
}

pub trait Near {
    fn near(self) -> Self;
}

macro_rules! numbers {
    ($($Float:ident)+; $($Integer:ident)+) => {
        $(impl Near for $Float {
            fn near(self) -> $Float {
                if self == 0.0 { 0.01 } else { self * 1.01 }
            }
        })+
        $(impl Near for $Integer {
            fn near(self) -> $Integer {
                self.wrapping_add(1)
            }
        })+
    };
}

numbers!(f32 f64; u8 u16 u32 u64 usize i32 i64 isize);

macro_rules! vectors {
    ($($Vector:ident)+) => {
        $(impl Near for glam::$Vector {
            fn near(self) -> glam::$Vector {
                if self == glam::$Vector::ZERO { glam::$Vector::splat(0.01) } else { self * 1.01 }
            }
        })+
    };
}

vectors!(Vec2 Vec3 Vec4);
