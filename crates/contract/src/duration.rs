// SPDX-License-Identifier: MPL-2.0

/// What is wrong with a property that was set to so many nanoseconds: what is shorter than a millisecond was meant in another unit.
pub fn mistaken_unit(property: &str, value: u64) -> Option<String> {
    (1..1_000_000).contains(&value).then(|| {
        format!(
            "`{property}`={value} is {value} ns: durations are in nanoseconds, and {value} ms would be {value}000000"
        )
    })
}
