//! What a panic does: nothing can link it.
//!
//! The function that the handler calls exists nowhere. Code that could panic keeps the handler, and with it a symbol
//! that the linker does not find; code that cannot loses both.

unsafe extern "C" {
    safe fn a_path_of_this_program_can_panic() -> !;
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    a_path_of_this_program_can_panic()
}
