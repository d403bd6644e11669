"""PlaceCubesDrawer: a Sawyer opens a drawer by its handle and puts cubes into it."""
