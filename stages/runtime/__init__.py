"""What every stage needs: the store of finished stages, the code's version, settings, files, and running one alone."""
