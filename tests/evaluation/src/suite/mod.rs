// SPDX-License-Identifier: MPL-2.0

//! Sets of tests besides the thesis' 72.

pub mod hard;
pub mod photo;
pub mod summary;
