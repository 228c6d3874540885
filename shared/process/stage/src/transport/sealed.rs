//! Values whose drop is compiled in this crate alone.

use std::{
    mem::ManuallyDrop,
    ops::{Deref, DerefMut},
};

/// A value of the transport. Its drop is long generic code, which each crate that drops such a
/// value would compile again. So it is reached through a pointer that is taken in this crate.
pub(super) struct Sealed<T> {
    value: ManuallyDrop<T>,
    drop: unsafe fn(&mut ManuallyDrop<T>),
}

impl<T> Sealed<T> {
    pub(super) fn new(value: T) -> Self {
        Self {
            value: ManuallyDrop::new(value),
            drop: ManuallyDrop::drop,
        }
    }

    pub(super) fn into_inner(self) -> T {
        let mut sealed = ManuallyDrop::new(self);
        // SAFETY: the value is taken once, since the rest of `self` is never dropped.
        unsafe { ManuallyDrop::take(&mut sealed.value) }
    }
}

impl<T> Drop for Sealed<T> {
    fn drop(&mut self) {
        // SAFETY: the value is dropped here alone, and nobody can use it afterwards.
        unsafe { (self.drop)(&mut self.value) }
    }
}

impl<T> Deref for Sealed<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.value
    }
}

impl<T> DerefMut for Sealed<T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.value
    }
}
