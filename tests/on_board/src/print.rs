//! A line of text and a number, by the emulator's console; `core::fmt` could panic.

use cortex_m_semihosting::hio;

/// Prints what was measured and its value.
pub fn line(name: &str, what: &str, value: u32) {
    let Ok(mut console) = hio::hstdout() else { return };
    let mut digits = [b'0'; 10];
    let mut rest = value;
    for digit in digits.iter_mut().rev() {
        *digit += (rest % 10) as u8;
        rest /= 10;
    }
    for text in [name.as_bytes(), what.as_bytes(), &digits, b"\n"] {
        let _ = console.write_all(text);
    }
}
