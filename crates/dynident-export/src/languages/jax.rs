//! Python with JAX: pure functions for `jax.jit`, `jax.grad` and `jax.vmap`.

use super::Source;
use super::python::{ArraySyntax, write_function, write_helpers, write_pure_step};
use core::fmt::Write;

pub(crate) fn jax_module(source: &Source<'_>) -> String {
    let (dof, syntax) = (source.dof(), ArraySyntax { library: "jnp" });
    let mut text = source.comment("#");
    let _ = write!(
        text,
        "\n# Pure functions of one state, or of any number of them: arrays of shape (..., {dof}).\n\
         # Numbers have 32 bits unless the program sets jax.config.update(\"jax_enable_x64\", True).\n\
         import jax.numpy as jnp\n\nDOF = {dof}\n"
    );
    write_helpers(&mut text, source, syntax.library);
    for function in &source.equations.functions {
        write_function(&mut text, source, function, &syntax);
    }
    if let Some(step) = &source.equations.step {
        write_pure_step(&mut text, source, step, &syntax);
    }
    text
}
