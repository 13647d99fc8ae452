//! Half precision: all of them, what becomes of others, and volumes of GeNVS that are kept in them.

use half::f16;
use viewfuse::device::cpu::Cpu;
use viewfuse::field::genvs::reference::Reference;
use viewfuse::field::genvs::{Architecture, Genvs, GenvsOptions, Omissions, test_networks};
use viewfuse::field::{Record, Rendered};
use viewfuse::job::progress::Silent;
use viewfuse::scene::photographs::SourceImages;
use viewfuse_core::half_precision::{MAX_F16, f16_bits, f16_value, fetch_f16, packed_f16, word_count};
use viewfuse_core::weights::Weights;
use viewfuse_tests::fields::{self, line};
use viewfuse_tests::lorry::{photographs, target};

#[test]
fn all_there_are() {
    for bits in 0..=u16::MAX {
        let (ours, theirs) = (f16_value(u32::from(bits)), f16::from_bits(bits));
        if theirs.is_nan() {
            assert!(ours.is_nan() && f16::from_bits(f16_bits(ours) as u16).is_nan(), "{bits:#06x}");
            continue;
        }
        assert_eq!(ours.to_bits(), theirs.to_f32().to_bits(), "{bits:#06x}");
        let back = if theirs.is_infinite() { bits - 1 } else { bits };
        assert_eq!(f16_bits(ours), u32::from(back), "{bits:#06x}");
        // What else stands in the word does not matter.
        assert_eq!(f16_value(0xabcd_0000 | u32::from(bits)).to_bits(), ours.to_bits());
    }
}

/// The bits that another hand rounds to; what it makes infinite is the largest.
fn expected(number: f32) -> u32 {
    let theirs = f16::from_f32(number);
    u32::from(if theirs.is_infinite() { theirs.to_bits() - 1 } else { theirs.to_bits() })
}

#[test]
fn halfway_between_two_and_beside_it() {
    for bits in 0..0x7bff_u16 {
        let (lower, upper) = (f16::from_bits(bits).to_f32(), f16::from_bits(bits + 1).to_f32());
        let middle = 0.5 * (lower + upper);
        for number in [middle, middle.next_down(), middle.next_up(), lower.next_up(), upper.next_down()] {
            assert_eq!(f16_bits(number), expected(number), "{number:e}");
            assert_eq!(f16_bits(-number), 0x8000 | expected(number), "{number:e}");
        }
        let even = u32::from(if bits % 2 == 0 { bits } else { bits + 1 });
        assert_eq!(f16_bits(middle), even, "{middle:e}");
    }
}

#[test]
fn what_is_too_large_is_the_largest() {
    for number in [65519.9, 65520.0, f32::MAX, f32::INFINITY] {
        assert_eq!([f16_value(f16_bits(number)), f16_value(f16_bits(-number))], [MAX_F16, -MAX_F16]);
    }
}

#[test]
fn two_in_a_word() {
    for numbers in [&[1.0, -2.0, 0.5][..], &[1.0, -2.0, 0.5, 3.0]] {
        let count = numbers.len() as u32;
        let words: Vec<u32> = (0..word_count(count) as usize).map(|word| packed_f16(numbers, count, word)).collect();
        assert_eq!((words.len(), words[0]), (2, 0xc000_3c00));
        let read: Vec<f32> = (0..numbers.len()).map(|index| fetch_f16(&words[..], index)).collect();
        assert_eq!(read, numbers);
    }
    // A number that is there and does not count is not packed.
    assert_eq!(packed_f16(&[1.0_f32, 1.0], 1, 0), 0x3c00);
}

const SIDE: u32 = 64;
const VIEWS: u32 = 3;

fn field(half_volumes: bool) -> Genvs {
    let omissions = Omissions { half_volumes, ..Omissions::default() };
    let options = GenvsOptions { omissions, ..GenvsOptions::default() };
    Genvs::new(test_networks::deterministic(&Architecture::small()), options).expect("a made network")
}

fn picture(field: &Genvs, sources: &SourceImages) -> (Rendered, Record) {
    fields::picture(&Cpu, field, sources, &Weights::mean(VIEWS), &target(SIDE), 0.0, &Silent).expect("a picture")
}

#[test]
fn a_volume_is_the_nearest_of_16_bits() {
    let sources = photographs(VIEWS, SIDE);
    let volume = |half_volumes| {
        let field = field(half_volumes);
        let mut reference = Reference::new(&field, &Cpu, &sources, &Silent).expect("a network on the device");
        reference.volume(1).expect("a volume")
    };
    let (whole, halves) = (volume(false), volume(true));
    let nearest: Vec<f32> = whole.iter().map(|value| f16::from_f32(*value).to_f32()).collect();
    assert!(halves == nearest && halves != whole);
}

/// What is looked up are sums with weights that sum to 1: off by no more than a feature of a volume is. What the
/// network makes of them may grow that; measured are 5e-5 of the largest feature.
#[test]
fn features_hardly_change() {
    let sources = photographs(VIEWS, SIDE);
    let features = |half_volumes| {
        let field = field(half_volumes);
        let mut reference = Reference::new(&field, &Cpu, &sources, &Silent).expect("a network on the device");
        let weights = [1.0 / VIEWS as f32; VIEWS as usize];
        reference.features(&weights, &target(SIDE).block(0), [0.8, 1.8], 1.0).expect("features")
    };
    let (whole, halves) = (features(false), features(true));
    let largest = whole.iter().fold(0.0_f32, |largest, value| largest.max(value.abs()));
    let off = whole.iter().zip(&halves).fold(0.0_f32, |off, (whole, half)| off.max((whole - half).abs()));
    assert!(off > 0.0 && off < 0.5_f32.powi(11) * largest, "{off:e} of {largest:e}");
}

/// Measured are 3e-5 of a picture's range.
#[test]
fn pictures_hardly_change_and_take_half_the_memory() {
    let sources = photographs(VIEWS, SIDE);
    let (exact, packed) = (field(false), field(true));
    let [(shown_whole, in_whole), (shown_halves, in_halves)] = [&exact, &packed].map(|field| picture(field, &sources));
    let off = fields::largest_difference(&shown_whole.colours, &shown_halves.colours);
    assert!(off > 0.0 && off < 0.5 / 255.0, "{off:e}");
    let whole = line(&in_whole, "volume bytes");
    let halves = line(&in_halves, "volume bytes");
    assert_eq!((whole.switch, whole.left_out), (false, 0));
    assert_eq!((halves.switch, halves.left_out * 2, halves.of), (true, whole.of, whole.of));
    // Rows cannot be omitted then: what they are made of is not kept.
    assert!(line(&in_whole, "volume rows").switch);
    let rows = line(&in_halves, "volume rows");
    assert_eq!((rows.switch, rows.left_out, rows.of), (false, 0, u64::from(VIEWS * SIDE)));
    // Before anything is there, more views cost less than half.
    let estimate = |field: &Genvs, count| field.memory_estimate(&Cpu, &vec![[SIDE; 2]; count]);
    let per_view = |field| (estimate(field, 9) - estimate(field, 1)) / 8;
    assert_eq!(per_view(&packed), whole.of / u64::from(VIEWS) / 2);
    assert!(2 * per_view(&packed) < per_view(&exact));
}
