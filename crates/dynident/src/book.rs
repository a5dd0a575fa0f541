//! The book's Rust examples, compiled and run as documentation tests.

macro_rules! chapters {
    ($($name:ident: $file:literal,)*) => {
        $(
            #[doc = include_str!(concat!("../../../docs/src/", $file))]
            pub mod $name {}
        )*
    };
}

chapters! {
    introduction: "introduction.md",
    first_identification: "first-identification.md",
    how_to: "how-to.md",
    robots: "robots.md",
    robot_formats: "robot-formats.md",
    logs: "logs.md",
    filters: "filters.md",
    dynamics: "dynamics.md",
    base_parameters: "base-parameters.md",
    estimation: "estimation.md",
    simulation: "simulation.md",
    validation: "validation.md",
}
