//! Followers: processes that read the journal of a run at their own pace, a module for each.

pub mod localisation;
pub mod loop_closure;
pub mod objects;
pub mod trajectory;
