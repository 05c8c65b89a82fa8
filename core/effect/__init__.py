"""What an author of an effect needs: places, changes of the matrices, parameters."""
