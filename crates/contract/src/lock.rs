// SPDX-License-Identifier: MPL-2.0

//! The one way both plugins take locks.

use std::sync::{Mutex, MutexGuard, PoisonError};

/// Locks even where a panic elsewhere poisoned it: one fault must not take the other threads with it.
pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
