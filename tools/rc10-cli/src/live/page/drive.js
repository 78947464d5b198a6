// The remote in the hand: keyboard, gamepad and mouse.
