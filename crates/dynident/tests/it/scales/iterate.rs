//! `iterate`.
