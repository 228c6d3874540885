//! Nothing, in place of bindgen, which takes half a minute to build: iceoryx2 names it for all
//! systems and calls it on QNX alone.
