//! The trajectory families, one file each.
