//! The rows of fields, and what other crates have for each.

use viewfuse::check::verify;
use viewfuse::field::rows::ROWS;

#[test]
fn every_learned_field_has_reference_values() {
    let learned: Vec<&str> = ROWS.iter().filter(|row| row.prefix().is_some()).map(|row| row.name).collect();
    assert_eq!(verify::fields(), learned);
}
