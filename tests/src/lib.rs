//! Helpers shared by the whole-family tests.
