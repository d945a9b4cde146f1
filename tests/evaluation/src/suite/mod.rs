// SPDX-License-Identifier: MPL-2.0

//! Sets of tests besides the thesis' 72 and the strata.

pub mod photo;
